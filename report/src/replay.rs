//! A recorded trial as a small file: 60 Hz, 32-bit floats.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Serialize};

/// Numbers of a frame: time (s); x, y, z (m), qx, qy, qz, qw of `world_from_hand`; the same of
/// `world_from_object` (mesh frame); distances of the left and the right pad from the hand's axis
/// (m); for each of both fingers its centre of pressure (m) and the normal force on the object (N).
/// World = the hand's frame at the start.
pub const NUMBERS_PER_FRAME: usize = 29;

/// One replay.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replay {
    /// The object.
    pub object: String,
    /// Number of the grasp.
    pub grasp: u64,
    /// How it ended.
    pub outcome: String,
    /// Frames per second; the last one may come sooner.
    pub hz: u32,
    /// Always [`NUMBERS_PER_FRAME`].
    pub numbers_per_frame: usize,
    /// Number of frames.
    pub frames: usize,
    /// The numbers as little-endian f32, base64.
    pub data: String,
}

impl Replay {
    /// Packs frames.
    pub fn new(
        object: &str,
        grasp: u64,
        outcome: &str,
        frames: impl Iterator<Item = [f32; NUMBERS_PER_FRAME]>,
    ) -> Self {
        let bytes: Vec<u8> = frames.flatten().flat_map(f32::to_le_bytes).collect();
        Self {
            object: object.to_owned(),
            grasp,
            outcome: outcome.to_owned(),
            hz: 60,
            numbers_per_frame: NUMBERS_PER_FRAME,
            frames: bytes.len() / (4 * NUMBERS_PER_FRAME),
            data: STANDARD.encode(bytes),
        }
    }

    /// The frames; `None` if the data does not hold them.
    pub fn numbers(&self) -> Option<Vec<[f32; NUMBERS_PER_FRAME]>> {
        let bytes = STANDARD.decode(&self.data).ok()?;
        let mut frames = bytes.chunks_exact(4 * NUMBERS_PER_FRAME);
        let all: Vec<_> = frames
            .by_ref()
            .map(|f| {
                std::array::from_fn(|i| {
                    f32::from_le_bytes(f[4 * i..4 * i + 4].try_into().expect("four bytes"))
                })
            })
            .collect();
        (frames.remainder().is_empty() && all.len() == self.frames).then_some(all)
    }

    /// The file's name under `replays/`.
    pub fn file_name(&self) -> String {
        format!("{}_{}.json", file_stem(&self.object), self.grasp)
    }
}

/// An object's identity as a file name: characters that a file system may not like are replaced, a
/// digest keeps names apart.
pub fn file_stem(object: &str) -> String {
    let safe: String = object
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
    let tag = &blake3::hash(object.as_bytes()).to_hex()[..8];
    format!("{safe}_{tag}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_come_back_and_a_cut_file_is_noticed() {
        let frame = |k: usize| std::array::from_fn(|i| (i * 7 + k) as f32 / 3.0);
        let mut replay = Replay::new("a/b", 4, "held", (0..5).map(frame));
        let numbers = replay.numbers().unwrap();
        assert_eq!(numbers.len(), 5);
        assert_eq!(numbers[3], frame(3));
        assert!(!replay.file_name().contains('/'));
        replay.frames = 6;
        assert!(replay.numbers().is_none());
    }
}
