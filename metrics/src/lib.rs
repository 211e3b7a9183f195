//! What the numbers say: rates with honest intervals, success over several candidates, agreement
//! with labels beside predictors that use no simulation.

pub mod agreement;
pub mod bootstrap;
pub mod interval;
pub mod rate;
pub mod summary;

pub use agreement::Agreement;
pub use summary::{Row, Summary};
