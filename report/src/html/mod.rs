//! `report.html`: one file that opens from disk, offline.

pub mod chart;
pub mod collect;
pub mod page;
