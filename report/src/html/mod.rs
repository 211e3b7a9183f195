//! `report.html` and the page of a comparison: files that open from disk, offline.

pub mod chart;
pub mod collect;
pub mod compare_page;
pub mod page;
