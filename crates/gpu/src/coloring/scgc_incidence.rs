//! Shortcut graph coloring from constraints and particles, without a list of edges.
//!
//! Twin of [`incise_coloring::scgc`] on an [`Incidence`](incise_graph::Incidence). A tetrahedron has about 65 neighbors
//! but four particles, so building and storing the graph costs more than this coloring. Degrees are counted on the
//! device first. Cost: a walk over the neighbors for the degrees, and one each time that the neighbor on which a
//! constraint waits is colored; 24 bytes per constraint and 8 per particle beside input and result.

use super::kernels::{
    ALL, ColoringKernels, INCIDENCE_DEGREES, SCGC_INCIDENCE, SCGC_INCIDENCE_WINDOW,
};
use super::rounds::{HEADER, Rounds, worklists};
use super::{DeviceColoring, DeviceIncidence};
use crate::array::Array;
use crate::{GpuContext, GpuError};

/// Words of `Wait` in the shaders.
pub(crate) const WAIT_WORDS: usize = 3;

/// Colors constraints with shortcuts 1 and 3; constraints that share a particle get different colors.
///
/// The coloring equals that of [`incise_coloring::scgc`] from the incidence or from its graph, bit for bit. For
/// clusters, pass the [`quotient`](incise_graph::Incidence::quotient). Counting the neighbors of a constraint takes
/// time quadratic in its number of particles, so constraints of very many particles are slow.
///
/// # Errors
/// If the device is lost or has no room for the work arrays.
///
/// ```
/// use incise_gpu::coloring::{ColoringKernels, DeviceIncidence, scgc_incidence};
/// use incise_gpu::{GpuContext, GpuError, GpuOptions};
/// use incise_graph::Incidence;
///
/// let gpu = match GpuContext::new(&GpuOptions::from_env()) {
///     Err(GpuError::NoAdapter { .. }) => return Ok(()),
///     other => other?,
/// };
/// let springs = Incidence::from_constraints(5, (0u32..5).map(|i| [i, (i + 1) % 5]))?;
/// let device = DeviceIncidence::new(&gpu, &springs)?;
/// let coloring = scgc_incidence(&gpu, &mut ColoringKernels::default(), &device)?;
/// assert_eq!(coloring.read(&gpu)?, incise_coloring::scgc(&springs).coloring);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn scgc_incidence(
    gpu: &GpuContext,
    kernels: &mut ColoringKernels,
    incidence: &DeviceIncidence,
) -> Result<DeviceColoring, GpuError> {
    let vertices = incidence.constraint_count();
    if vertices == 0 {
        return DeviceColoring::empty(gpu);
    }
    let array = Array::zeros(gpu, "colors", vertices)?;
    let degrees = kernels.array(gpu, "degrees", vertices)?;
    let waits = kernels.array(gpu, "waits", WAIT_WORDS * vertices)?;
    let taken_words = 2 * incidence.particle_count();
    let taken = kernels.array(gpu, "taken", taken_words)?;
    let work = worklists(gpu, kernels, vertices)?;
    let (parts, colors) = (incidence.parts.buffer(), array.buffer());
    let (particles_of, constraints_of) = (
        incidence.particles_of.buffer(),
        incidence.constraints_of.buffer(),
    );
    let count = [parts, &work, particles_of, constraints_of, &degrees];
    let pass = [
        parts,
        &work,
        particles_of,
        constraints_of,
        &degrees,
        colors,
        &waits,
        &taken,
    ];
    let first = Rounds {
        algorithm: "scgc_incidence",
        vertices,
        max_rounds: usize::MAX,
        clear: vec![
            (&work, HEADER),
            (&waits, WAIT_WORDS * vertices),
            (&taken, taken_words),
        ],
        first: vec![
            kernels.bind(gpu, &INCIDENCE_DEGREES, &count)?,
            kernels.bind(gpu, &ALL, &[parts, &work, colors])?,
        ],
        round: vec![kernels.bind(gpu, &SCGC_INCIDENCE, &pass)?],
    };
    let mut state = first.run(gpu, kernels, &incidence.parts)?;
    while state.rest > 0 {
        let window = Rounds {
            algorithm: "scgc_incidence",
            vertices,
            max_rounds: usize::MAX,
            clear: vec![(&taken, taken_words)],
            first: vec![kernels.bind(
                gpu,
                &SCGC_INCIDENCE_WINDOW,
                &[parts, &work, colors, &waits],
            )?],
            round: vec![kernels.bind(gpu, &SCGC_INCIDENCE, &pass)?],
        };
        let next = window.run(gpu, kernels, &incidence.parts)?;
        // Every window colors a constraint.
        if next.rest >= state.rest {
            return Err(GpuError::Stalled {
                algorithm: "scgc_incidence",
                rounds: next.rounds as usize,
            });
        }
        state = next;
    }
    Ok(state.into_coloring(array))
}
