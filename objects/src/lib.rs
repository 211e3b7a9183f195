//! What is grasped: geometry with mass.
//!
//! A mesh file becomes a validated [`TriMesh`] in metres ([`io`]), gets mass properties
//! ([`MassProperties`]), a [`Surface`] index that answers "what touches this convex body?", convex
//! pieces ([`pieces`]) and a signed distance grid ([`SdfGrid`]). [`Object`] ties them together;
//! [`set`] reads object sets, and [`shapes`] draws the embedded household objects.

pub(crate) mod blocks;
pub mod convex;
pub mod error;
pub mod io;
mod lanes;
pub mod mass;
pub mod mesh;
pub mod normalised_sdf;
pub mod object;
pub mod penetration;
pub mod pieces;
pub mod sdf;
pub mod set;
pub mod shapes;
mod snug;
mod stretch;
pub mod surface;
pub mod triangle;

pub use convex::ConvexBody;
pub use error::{ObjectError, Place};
pub use mass::MassProperties;
pub use mesh::{MeshReport, TriMesh};
pub use normalised_sdf::{NormalisedSdf, Probe};
pub use object::{Object, ObjectSpec};
pub use sdf::{Normalisation, SdfGrid};
pub use surface::Surface;
