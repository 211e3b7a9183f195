//! Household shapes that anybody may have: parametric, watertight, of real sizes and masses.

mod family;
pub mod loft;
mod profiles;
mod shape;

pub use family::{Family, Split};
pub use shape::{Shape, embedded};
