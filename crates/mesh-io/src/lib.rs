//! Reads and writes files of tetrahedral meshes and triangle surfaces in common formats.
//!
//! The ending of a file name selects the format:
//!
//! | ending | feature | format | read | written | kept beside the tets |
//! |---|---|---|---|---|---|
//! | `.vtk` | `vtk` | legacy VTK 2.0 to 5.1, text and binary | yes | 4.2 text, 5.1 binary ([`write_vtk_binary`]) | regions, scalars, vectors |
//! | `.vtu` | `vtu` | VTK XML unstructured grid: text, base64, appended, zlib | yes | base64; appended with zlib ([`write_vtu_compressed`]) | regions, scalars, vectors |
//! | `.msh` | `msh` | Gmsh 1, 2 and 4.1, text and binary | yes | 4.1 and 2.2 ([`write_msh`]) | regions (physical groups, without their names), scalars, vectors |
//! | `.node`, `.ele` | `tetgen` | TetGen, a pair of files | yes | yes | regions, up to 256 attributes, markers |
//! | `.mesh`, `.meshb` | `medit` | Medit, text and binary | yes | yes | regions (references), references of points |
//! | `.obj`, `.off`, `.ply`, `.stl` | `obj`, `off`, `ply`, `stl` | triangle surfaces | [`read_surface`] | [`write_surface`], [`write_ply`], [`write_stl_binary`] | `.obj`: texture coordinates ([`SurfaceFile`]) |
//! | `.glb`, `.gltf` | `gltf` | glTF 2.0 | [`read_surface`], the triangles of the scene | [`write_surface`], rounded to floats | texture coordinates; written: normals |
//! | `.vtp` | `vtu` | VTK XML surface with fields | | [`write_vtp`] | scalars, vectors |
//! | `.pvd` | `vtu` | ParaView collection of time steps | | [`write_pvd`] | |
//!
//! ```
//! use incise_mesh::{TriangleSurface, glam::DVec3, kuhn_box};
//! use incise_mesh_io as io;
//!
//! let folder = std::env::temp_dir().join(format!("incise-mesh-io-doc-{}", std::process::id()));
//! std::fs::create_dir_all(&folder)?;
//!
//! // The mesh only; coordinates keep every bit.
//! let mesh = kuhn_box([4, 2, 2], DVec3::new(2.0, 1.0, 1.0));
//! io::write(folder.join("box.vtk"), &mesh)?;
//! assert_eq!(io::read(folder.join("box.vtk"))?, mesh);
//!
//! // With regions, and values of particles and tets.
//! let mut file = io::MeshFile::from(mesh);
//! file.regions = vec![7; file.mesh.tets.len()];
//! io::write_file(folder.join("box.msh"), &file)?;
//! assert_eq!(io::read_file(folder.join("box.msh"))?, file);
//!
//! // Surfaces, and content in memory.
//! let surface = TriangleSurface::boundary_of(&file.mesh);
//! io::write_surface(folder.join("box.stl"), &surface)?;
//! let bytes = std::fs::read(folder.join("box.stl"))?;
//! assert_eq!(io::parse_surface("box.stl", &bytes)?.triangles.len(), surface.triangles.len());
//!
//! // An error has the file, the line or byte, and the reason.
//! let error = io::parse_file("box.mesh", b"MeshVersionFormatted 2\nDimension 2").unwrap_err();
//! assert!(error.to_string().starts_with("box.mesh:2: "));
//! # std::fs::remove_dir_all(folder).ok();
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Each format is a Cargo feature; all are on by default. For a format that is left out the error is
//! [`MeshIoError::FormatLeftOut`], which names the feature.
//!
//! Written coordinates keep every bit. Readers do not trust numbers in a file: they reserve no more memory than the
//! file could fill, never panic, and report file and line of an error. A file is written under a temporary name and
//! renamed when complete. Time and memory are linear in the size of the file.
//!
//! Reading takes at most ten times the size of a usual file as memory, and 20 times that of any file, with three
//! exceptions: 64 times for fields of single bits in VTK files, since each becomes a double; for a compressed
//! `.vtu` five times its decompressed size, which is bounded by its counts and can be 1032 times the compressed size; and
//! for glTF up to 500 times the size of its text, where empty objects of three bytes become structures.

// With some formats only, parts of the shared code are unused.
#![cfg_attr(
    not(feature = "default"),
    allow(
        dead_code,
        unused_variables,
        reason = "what only the formats that are left out use"
    )
)]

mod atomic;
#[cfg(any(feature = "vtu", feature = "gltf"))]
mod base64;
mod endings;
mod error;
mod fields;
mod file;
mod formats;
#[cfg(feature = "gltf")]
mod gltf;
#[cfg(feature = "medit")]
mod medit;
#[cfg(feature = "msh")]
mod msh;
#[cfg(feature = "obj")]
mod obj;
#[cfg(feature = "off")]
mod off;
#[cfg(feature = "ply")]
mod ply;
mod polygon;
#[cfg(feature = "vtu")]
mod pvd;
#[cfg(feature = "stl")]
mod stl;
mod surface_file;
mod surfaces;
#[cfg(test)]
mod test_files;
#[cfg(feature = "tetgen")]
mod tetgen;
mod text;
mod used_particles;
#[cfg(feature = "vtk")]
mod vtk;
#[cfg(any(feature = "vtk", feature = "vtu"))]
mod vtk_grid;
#[cfg(any(feature = "vtk", feature = "vtu"))]
mod vtk_kind;
#[cfg(feature = "vtu")]
mod vtp;
#[cfg(feature = "vtu")]
mod vtu;
#[cfg(feature = "vtu")]
mod xml;

pub use atomic::write_atomically;
pub use error::MeshIoError;
pub use fields::{Field, Fields, Values};
pub use file::{MeshFile, NamedValues, OwnedValues};
pub use formats::{is_mesh, parse_file, read, read_file, write, write_file};
#[cfg(feature = "medit")]
pub use medit::{read_medit, write_medit};
#[cfg(feature = "msh")]
pub use msh::{MshKind, read_msh, write_msh};
#[cfg(feature = "ply")]
pub use ply::{PlyEncoding, write_ply};
#[cfg(feature = "vtu")]
pub use pvd::write_pvd;
#[cfg(feature = "stl")]
pub use stl::write_stl_binary;
pub use surface_file::SurfaceFile;
pub use surfaces::{
    is_surface, parse_surface, parse_surface_file, read_surface, read_surface_file, write_surface,
    write_surface_file,
};
#[cfg(feature = "tetgen")]
pub use tetgen::{parse_tetgen, read_tetgen, read_tetgen_file, write_tetgen, write_tetgen_file};
#[cfg(feature = "vtk")]
pub use vtk::{read_vtk, read_vtk_file, write_vtk, write_vtk_binary, write_vtk_file};
#[cfg(feature = "vtu")]
pub use vtp::write_vtp;
#[cfg(feature = "vtu")]
pub use vtu::{read_vtu, write_vtu, write_vtu_compressed, write_vtu_file};

/// Compiles the example of the README.
#[cfg(all(doctest, feature = "default"))]
#[doc = include_str!("../README.md")]
struct Readme;
