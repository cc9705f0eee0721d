//! glTF 2.0 (`.glb` and `.gltf`): surfaces of modelers, viewers, engines and browsers.
//!
//! The second axis of glTF points up, ours is the third: reading and writing turn between them. Texture coordinates of
//! glTF go down from the upper corner of the image, ours up from the lower one. Source: "glTF 2.0 Specification"
//! (Khronos).

mod read;
mod write;

pub(super) use read::parse;
pub(super) use write::{write_glb, write_gltf};

/// The numbers that mark a binary file and its two parts.
const MAGIC: &[u8; 4] = b"glTF";
const JSON: &[u8; 4] = b"JSON";
const BIN: &[u8; 4] = b"BIN\0";
