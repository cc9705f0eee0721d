//! [`shaders`]: the text of every kernel, for other compilers to check, and the host's layout of their structs.

use std::mem::offset_of;

use crate::coloring::{Round, SEARCH_WORDS, VivaceSettings, WAIT_WORDS, WlcWork, Work};
use crate::solver::{
    Attachment, ContactUniform, DispatchRange, IterationUniform, ParticlePatch, ParticleSums,
    Settings, TetPatch, TetSums, Units,
};
use crate::{coloring, solver};

/// A kernel as it is passed to the driver; its entry point is `main`.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Shader {
    /// The name of the kernel and of its file.
    pub name: &'static str,
    /// WGSL, including the shared parts in front.
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
    let colorings = coloring::SOURCES.iter();
    let colorings = colorings.map(|source| (source.name, source.parts));
    let solver = solver::SOURCES.iter();
    let solver = solver.map(|source| (source.name, source.parts));
    let shader = |(name, parts): (_, &[&str])| Shader {
        name,
        source: parts.concat(),
    };
    colorings.chain(solver).map(shader).collect()
}

/// The host's layout of a struct that kernels use.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SharedStruct {
    /// The name of the struct in all kernels that have it.
    pub name: &'static str,
    /// All fields with their offsets in bytes, without an unsized list at the end; empty if the host only allocates the
    /// struct.
    pub fields: Vec<(&'static str, usize)>,
    /// The size in bytes, without an unsized list at the end.
    pub size: usize,
}

macro_rules! shared {
    ($of:ident { $($field:ident),* }) => {
        SharedStruct {
            name: stringify!($of),
            fields: vec![$((stringify!($field), offset_of!($of, $field))),*],
            size: size_of::<$of>(),
        }
    };
    ($name:literal, $words:expr) => {
        SharedStruct {
            name: $name,
            fields: vec![],
            size: $words * size_of::<u32>(),
        }
    };
}

/// All structs that host and kernels share.
///
/// ```
/// for shared in incise_gpu::shared_structs() {
///     assert!(shared.fields.iter().all(|&(_, offset)| offset < shared.size));
/// }
/// ```
#[must_use]
pub fn shared_structs() -> Vec<SharedStruct> {
    vec![
        shared!(Round { vertices, parity }),
        shared!(Work {
            counts,
            rounds,
            colors,
            rest,
            window
        }),
        shared!(VivaceSettings {
            seed_low,
            seed_high,
            shrinking,
            highest_of_all
        }),
        shared!(WlcWork {
            begin,
            count,
            done,
            lost,
            chunk,
            rounds
        }),
        shared!(Settings {
            gravity,
            time,
            time_squared,
            per_time,
            relaxation,
            one,
            half,
            max_cofactor_norm,
            particles,
            depth,
            colliders,
            handles,
            rigid,
            soft,
            material
        }),
        shared!(DispatchRange { first, count }),
        shared!(IterationUniform {
            substep,
            iteration,
            weight,
            unused
        }),
        shared!(ContactUniform {
            friction,
            kept,
            margin,
            unused
        }),
        shared!(Attachment {
            anchor,
            particle,
            handle,
            compliance,
            damping,
            unused
        }),
        shared!(TetPatch {
            tet_slot,
            unused,
            corners,
            rest,
            constants
        }),
        shared!(ParticlePatch {
            particle,
            velocity,
            index
        }),
        shared!(Units {
            tet_slots,
            length,
            slope,
            unused
        }),
        shared!(TetSums {
            energy,
            change,
            least,
            inverted
        }),
        shared!(ParticleSums {
            moment,
            kinetic,
            speed_squared,
            unused
        }),
        shared!("Search", SEARCH_WORDS),
        shared!("Wait", WAIT_WORDS),
    ]
}
