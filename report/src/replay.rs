//! A recorded trial as a small JSON file.

use serde::Serialize;

/// One replay: poses at 60 Hz. World = the hand's frame at the start.
#[derive(Debug, Clone, Serialize)]
pub struct Replay {
    /// The object.
    pub object: String,
    /// Number of the grasp.
    pub grasp: u64,
    /// How it ended.
    pub outcome: &'static str,
    /// Times, s.
    pub t_s: Vec<f32>,
    /// x, y, z (m), qx, qy, qz, qw of `world_from_hand` per frame.
    pub world_from_hand: Vec<[f32; 7]>,
    /// The same of `world_from_object`, the mesh frame.
    pub world_from_object: Vec<[f32; 7]>,
    /// Distances of the left and the right pad from the hand's axis per frame, metres.
    pub finger_m: Vec<[f32; 2]>,
}

impl Replay {
    /// The file's name under `replays/`; characters that a file system may not like are replaced.
    pub fn file_name(&self) -> String {
        let safe: String = self
            .object
            .chars()
            .map(|c| {
                if c.is_ascii_alphanumeric() || "._-".contains(c) {
                    c
                } else {
                    '_'
                }
            })
            .take(80)
            .collect();
        let tag = &blake3::hash(self.object.as_bytes()).to_hex()[..8];
        format!("{safe}_{tag}_{}.json", self.grasp)
    }
}
