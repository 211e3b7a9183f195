//! Which convex pieces is this solid made of? parry's VHACD, with settings that keep a mug
//! hollow, cached on disk under the hash of geometry and settings.
//!
//! K. Mamou and F. Ghorbel, "A simple and efficient approach for 3D mesh approximate convex
//! decomposition", ICIP 2009.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use nalgebra::Point3;
use parry3d::transformation::vhacd::{VHACD, VHACDParameters};
use parry3d::transformation::voxelization::FillMode;

use crate::mesh::TriMesh;

/// Changes whenever the meaning of a cached file does.
const CACHE_VERSION: &str = "pieces-v2";

/// How finely a solid is cut.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PieceSettings {
    /// Voxels along the longest edge. 56 resolves the wall of a mug; 32 fills its cavity.
    pub resolution: u32,
    /// Largest concavity left in a piece, as a fraction of the normalised size.
    pub concavity: f64,
    /// Most pieces.
    pub max_pieces: u32,
}

impl Default for PieceSettings {
    fn default() -> Self {
        Self {
            resolution: 56,
            concavity: 0.0025,
            max_pieces: 64,
        }
    }
}

/// Corner lists of the convex pieces of `mesh`, object frame, metres.
///
/// Deterministic: the same mesh and settings give the same bits, from the cache or not.
pub fn decompose(mesh: &TriMesh, settings: &PieceSettings) -> Vec<Vec<Point3<f64>>> {
    let (lo, hi) = mesh.bounds();
    let centre = nalgebra::center(&lo, &hi);
    let size = (hi - lo).max();
    let points: Vec<parry3d::math::Vector> = mesh
        .vertices()
        .iter()
        .map(|v| {
            let q = (v - centre) / size;
            parry3d::math::Vector::new(q.x as f32, q.y as f32, q.z as f32)
        })
        .collect();
    let parameters = VHACDParameters {
        resolution: settings.resolution,
        concavity: settings.concavity as f32,
        max_convex_hulls: settings.max_pieces,
        fill_mode: FillMode::FloodFill {
            detect_cavities: false,
        },
        convex_hull_approximation: false,
        // Hulls of candidate cuts from every eighth voxel: two thirds of the time, two points of
        // volume on a mug.
        convex_hull_downsampling: 8,
        ..VHACDParameters::default()
    };
    let decomposition = VHACD::decompose(&parameters, &points, mesh.faces(), true);
    decomposition
        .compute_exact_convex_hulls(&points, mesh.faces())
        .into_iter()
        .map(|(corners, _)| {
            corners
                .iter()
                .map(|c| centre + nalgebra::Vector3::new(c.x, c.y, c.z).map(f64::from) * size)
                .collect()
        })
        .filter(|corners: &Vec<Point3<f64>>| corners.len() >= 4)
        .collect()
}

/// Like [`decompose`], through the cache in `directory` (none: no cache).
///
/// Files are written under a name of their own and renamed into place, so that two processes can
/// write the same entry at once; a damaged entry is recognised by its hash and made again. A
/// cache that cannot be written never fails a run.
pub fn decompose_cached(
    mesh: &TriMesh,
    settings: &PieceSettings,
    directory: Option<&Path>,
) -> Vec<Vec<Point3<f64>>> {
    let Some(directory) = directory else {
        return decompose(mesh, settings);
    };
    let key = blake3::hash(
        format!(
            "{CACHE_VERSION} {} {} {} {}",
            mesh.content_hash(),
            settings.resolution,
            settings.concavity,
            settings.max_pieces
        )
        .as_bytes(),
    )
    .to_hex();
    let path = directory.join(format!("{key}.pieces"));
    if let Some(pieces) = fs::read(&path).ok().and_then(|bytes| decode(&bytes)) {
        return pieces;
    }
    let pieces = decompose(mesh, settings);
    let _ = write_atomically(directory, &path, &encode(&pieces));
    pieces
}

/// Where the cache lies unless told otherwise: `$SHAKEDOWN_CACHE`, `$XDG_CACHE_HOME/shakedown` or
/// `~/.cache/shakedown`.
pub fn default_cache_directory() -> Option<PathBuf> {
    let var = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty());
    var("SHAKEDOWN_CACHE").map(PathBuf::from).or_else(|| {
        var("XDG_CACHE_HOME")
            .map(PathBuf::from)
            .or_else(|| var("HOME").map(|h| PathBuf::from(h).join(".cache")))
            .map(|p| p.join("shakedown"))
    })
}

fn write_atomically(directory: &Path, path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    use std::sync::atomic::{AtomicU64, Ordering};
    static SERIAL: AtomicU64 = AtomicU64::new(0);
    fs::create_dir_all(directory)?;
    let serial = SERIAL.fetch_add(1, Ordering::Relaxed);
    let temporary = path.with_extension(format!("{}-{serial}.tmp", std::process::id()));
    let mut file = fs::File::create(&temporary)?;
    let written = file
        .write_all(bytes)
        .and_then(|()| fs::rename(&temporary, path));
    if written.is_err() {
        let _ = fs::remove_file(&temporary);
    }
    written
}

/// hash (32 bytes) | pieces | (corners | x y z ...) ...; integers u64, floats f64, little endian.
fn encode(pieces: &[Vec<Point3<f64>>]) -> Vec<u8> {
    let mut body = (pieces.len() as u64).to_le_bytes().to_vec();
    for piece in pieces {
        body.extend((piece.len() as u64).to_le_bytes());
        for corner in piece {
            body.extend(corner.iter().flat_map(|x| x.to_le_bytes()));
        }
    }
    let mut bytes = blake3::hash(&body).as_bytes().to_vec();
    bytes.append(&mut body);
    bytes
}

fn decode(bytes: &[u8]) -> Option<Vec<Vec<Point3<f64>>>> {
    let (hash, mut body) = bytes.split_at_checked(32)?;
    if blake3::hash(body).as_bytes() != hash {
        return None;
    }
    let mut take = || {
        let (head, rest) = body.split_first_chunk::<8>()?;
        body = rest;
        Some(*head)
    };
    let count = u64::from_le_bytes(take()?);
    let mut pieces = Vec::new();
    for _ in 0..count {
        let corners = u64::from_le_bytes(take()?);
        let mut piece = Vec::new();
        for _ in 0..corners {
            let [x, y, z] = [take()?, take()?, take()?].map(f64::from_le_bytes);
            piece.push(Point3::new(x, y, z));
        }
        pieces.push(piece);
    }
    Some(pieces)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convex::ConvexBody;
    use crate::shapes::Family;

    #[test]
    fn a_mug_stays_hollow_and_the_bits_repeat() {
        let mesh = Family::Mug.member(0).mesh().unwrap();
        let settings = PieceSettings::default();
        let pieces = decompose(&mesh, &settings);
        let (lo, hi) = mesh.bounds();
        // The axis of the cup at half height is inside the cavity: no piece may cover it.
        let middle = Point3::new(0.0, 0.0, (lo.z + hi.z) / 2.0);
        for piece in &pieces {
            let body = ConvexBody::hull(piece);
            assert!(body.is_none_or(|b| !b.contains(&middle)));
        }
        assert!(pieces.len() > 8);
        assert_eq!(pieces, decompose(&mesh, &settings));
    }

    #[test]
    fn cached_pieces_equal_fresh_ones_and_damage_is_noticed() {
        let mesh = Family::Knife.member(0).mesh().unwrap();
        let settings = PieceSettings {
            resolution: 24,
            ..PieceSettings::default()
        };
        let fresh = decompose(&mesh, &settings);
        let directory = tempfile::tempdir().unwrap();
        let cached = |d: &Path| decompose_cached(&mesh, &settings, Some(d));
        assert_eq!(cached(directory.path()), fresh);
        assert_eq!(cached(directory.path()), fresh);
        let entry = fs::read_dir(directory.path())
            .unwrap()
            .next()
            .unwrap()
            .unwrap()
            .path();
        let mut bytes = fs::read(&entry).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        fs::write(&entry, &bytes).unwrap();
        assert!(decode(&bytes).is_none());
        assert_eq!(cached(directory.path()), fresh);
    }

    #[test]
    fn two_writers_at_once_leave_one_good_entry() {
        let mesh = Family::Ring.member(0).mesh().unwrap();
        let settings = PieceSettings {
            resolution: 16,
            ..PieceSettings::default()
        };
        let directory = tempfile::tempdir().unwrap();
        let results: Vec<_> = std::thread::scope(|s| {
            let handles: Vec<_> = (0..4)
                .map(|_| s.spawn(|| decompose_cached(&mesh, &settings, Some(directory.path()))))
                .collect();
            handles.into_iter().map(|h| h.join().unwrap()).collect()
        });
        assert!(results.windows(2).all(|w| w[0] == w[1]));
        let names: Vec<_> = fs::read_dir(directory.path())
            .unwrap()
            .map(|e| e.unwrap().path())
            .collect();
        assert_eq!(names.len(), 1, "{names:?}");
        assert_eq!(decode(&fs::read(&names[0]).unwrap()).unwrap(), results[0]);
    }
}
