//! [`shaders`]: the text of every kernel, for other compilers to check, and what its structs are on the host.

use std::mem::offset_of;

use crate::coloring::{Round, SOURCES, VivaceSettings, WlcWork, Work};

/// A kernel as it is given to the driver; its entry point is `main`.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Shader {
    /// The name, which is that of its file.
    pub name: &'static str,
    /// WGSL, with the parts that it shares with others in front.
    pub source: String,
}

/// All kernels of this crate.
///
/// ```
/// for shader in incise_gpu::shaders() {
///     assert!(shader.source.contains("fn main"), "{}", shader.name);
/// }
/// ```
#[must_use]
pub fn shaders() -> Vec<Shader> {
    SOURCES
        .iter()
        .map(|source| Shader {
            name: source.name,
            source: source.parts.concat(),
        })
        .collect()
}

/// Where a struct that host and kernels share has its fields on the host.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SharedStruct {
    /// Its name, the same in all kernels that have it.
    pub name: &'static str,
    /// Field and offset in bytes. What follows the last one on the device only is there with the size.
    pub fields: Vec<(&'static str, usize)>,
}

macro_rules! shared {
    ($of:ident { $($field:ident),* } $($rest:literal)?) => {
        SharedStruct {
            name: stringify!($of),
            fields: vec![
                $((stringify!($field), offset_of!($of, $field)),)*
                $(($rest, size_of::<$of>()),)?
            ],
        }
    };
}

/// All structs that host and kernels share.
#[must_use]
pub fn shared_structs() -> Vec<SharedStruct> {
    vec![
        shared!(Round { vertices, parity }),
        shared!(Work { counts, rounds, colors, rest, window } "list"),
        shared!(VivaceSettings {
            seed_low,
            seed_high,
            shrinking,
            highest_of_all
        }),
        shared!(WlcWork { begin, count, done, lost, chunk, rounds } "list"),
    ]
}
