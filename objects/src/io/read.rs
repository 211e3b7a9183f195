//! Recognises a mesh file by its content and hands it to the right reader.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

use super::guard::caught;
use super::{gltf, obj, off, ply, stl};
use crate::error::{ObjectError, Place};
use crate::mesh::{MeshReport, RawMesh, TriMesh};

/// The mesh formats that can be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MeshFormat {
    /// Wavefront OBJ.
    Obj,
    /// Stereolithography, text or binary.
    Stl,
    /// Polygon file format, text or binary.
    Ply,
    /// glTF 2.0, JSON or GLB.
    Gltf,
    /// Object file format.
    Off,
}

impl MeshFormat {
    /// The format of a file: by its first bytes where they tell, by its name otherwise.
    pub fn detect(bytes: &[u8], path: &Path) -> Option<Self> {
        let extension = path
            .extension()
            .map(|e| e.to_string_lossy().to_ascii_lowercase())
            .unwrap_or_default();
        let head = bytes.get(..4).unwrap_or(bytes);
        if head == b"glTF" {
            return Some(Self::Gltf);
        }
        if head.starts_with(b"ply") {
            return Some(Self::Ply);
        }
        if head.starts_with(b"OFF") || head.starts_with(b"COFF") {
            return Some(Self::Off);
        }
        match extension.as_str() {
            "obj" => Some(Self::Obj),
            "stl" => Some(Self::Stl),
            "gltf" | "glb" => Some(Self::Gltf),
            "ply" => Some(Self::Ply),
            "off" => Some(Self::Off),
            _ => None,
        }
    }
}

/// Largest mesh file that is read, bytes: some ten million triangles. What a file unpacks to stays
/// within a small multiple.
pub const MESH_BYTES_MAX: u64 = 512 << 20;

/// The bytes of a file that must not be larger than `limit`; a stranger's file may be a device
/// without end.
///
/// # Errors
/// Those of reading, and `FileTooLarge`.
pub fn read_at_most(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        let what = format!(
            "the file has over {} MiB, the most that is read",
            limit >> 20
        );
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, what));
    }
    Ok(bytes)
}

/// Returns the validated mesh of a file, in file units, and what was mended.
///
/// # Errors
/// [`ObjectError`] naming the file, the line or face, and the mend.
pub fn read_mesh(path: &Path) -> Result<(TriMesh, MeshReport), ObjectError> {
    let bytes = read_at_most(path, MESH_BYTES_MAX).map_err(|e| ObjectError::io(path, e))?;
    parse_mesh(&bytes, path)
}

/// Like [`read_mesh`], of bytes at hand; `path` tells the name, and where glTF buffers lie.
///
/// # Errors
/// As [`read_mesh`].
pub fn parse_mesh(bytes: &[u8], path: &Path) -> Result<(TriMesh, MeshReport), ObjectError> {
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(ObjectError::bad(
            path,
            Place::Whole,
            "the file is empty",
            "export the mesh again",
        ));
    }
    let format = MeshFormat::detect(bytes, path).ok_or_else(|| {
        ObjectError::bad(
            path,
            Place::Whole,
            "not a mesh format that is known here",
            "use OBJ, STL, PLY, glTF/GLB or OFF, with that extension",
        )
    })?;
    let parsed = caught(|| match format {
        MeshFormat::Obj => obj::parse(bytes, path),
        MeshFormat::Stl => stl::parse(bytes, path),
        MeshFormat::Ply => ply::parse(bytes, path),
        MeshFormat::Gltf => gltf::parse(bytes, path),
        MeshFormat::Off => off::parse(bytes, path),
    });
    let raw: RawMesh = parsed.unwrap_or_else(|panic| {
        let what = format!("the file is damaged: {panic}");
        Err(ObjectError::bad(
            path,
            Place::Whole,
            what,
            "export the mesh again",
        ))
    })?;
    TriMesh::from_raw(raw, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_beyond_the_limit_is_an_error_even_if_it_never_ends() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("three");
        std::fs::write(&path, b"abc").unwrap();
        assert_eq!(read_at_most(&path, 3).unwrap(), b"abc");
        let error = read_at_most(&path, 2).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
        #[cfg(unix)]
        assert!(read_at_most(Path::new("/dev/zero"), 1 << 16).is_err());
    }
}
