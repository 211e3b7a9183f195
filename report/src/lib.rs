//! What people and CI read: the run directory of the contract and its files.

pub mod baseline;
#[cfg(feature = "parquet")]
pub mod columnar;
pub mod comparison;
pub mod glb;
pub mod html;
pub mod journal;
pub mod manifest;
pub mod markdown;
pub mod merge;
pub mod reference;
pub mod replay;
pub mod results;
pub mod rows;
pub mod store;
pub mod table;
pub mod trials;
pub mod view;

pub use manifest::{Manifest, ManifestObject};
pub use merge::Shard;
pub use store::{Store, StoreError};
pub use trials::TrialRow;
