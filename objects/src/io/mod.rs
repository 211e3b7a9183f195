//! Which file is this, and what mesh does it hold? Readers for OBJ, STL, PLY, glTF/GLB and OFF.

pub mod gltf;
pub mod obj;
pub mod off;
pub mod ply;
pub mod stl;

mod guard;
mod read;

pub use guard::caught;
pub use read::{MESH_BYTES_MAX, MeshFormat, parse_mesh, read_at_most, read_mesh};
