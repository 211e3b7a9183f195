//! What the numbers say: rates with honest intervals, success over several candidates, agreement
//! with labels beside predictors that use no simulation.

pub mod agreement;
pub mod assignment;
pub mod bootstrap;
pub mod calibration;
pub mod compare;
pub mod distribution;
pub mod features;
pub mod hold_model;
pub mod interval;
pub mod paired;
pub mod polytope;
pub mod power;
pub mod ranking;
pub mod rate;
pub mod summary;
pub mod wrench_space;

pub use agreement::Agreement;
pub use compare::{Comparison, Gate, compare};
pub use summary::{Row, Summary};
