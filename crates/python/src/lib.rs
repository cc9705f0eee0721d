//! The Python module `incise`: bodies from NumPy arrays, live cutting, coloring and clustering.
//!
//! A thin layer over the facade: arguments are read to Rust's values, the interpreter is released, the facade is called, and
//! the result becomes NumPy arrays and dictionaries. Settings are dictionaries with the keys of a scene file. There are no
//! algorithms here. Doc comments of classes and functions are Python's docstrings; `incise.pyi` has the types.
//!
//! Cost: a copy of the arrays that are passed.

#![allow(
    clippy::doc_markdown,
    reason = "doc comments are Python's docstrings, in the format of numpydoc"
)]

mod array;
mod body;
mod compute;
mod failure;
mod handles;
mod mesh;
mod scene;
mod scheduling;
mod simulation;
mod snapshot;
mod surface;
mod value;

use pyo3::prelude::*;

/// Cuts soft bodies in real time: tetrahedral meshes, XPBD and implicit elasticity, and the coloring that keeps the solver
/// parallel.
///
/// >>> import incise
/// >>> bar = incise.Body(incise.Mesh.generate("beam", 2000), young_modulus=2e5, pinned=lambda x: x[:, 0] < -0.4)
/// >>> sim = incise.Simulation(bar, gravity=(0, 0, -9.81))
/// >>> sim.cut_plane((0.1, 0, 0), (1, 0, 0))
/// >>> sim.step()["pieces"]
/// 2
///
/// Units are m, s, kg, N, Pa. Arrays that are returned are read-only copies, which stay valid; arrays that are passed may
/// have any memory layout. Invalid input raises ``ValueError``, a failed run ``RuntimeError``.
#[pymodule(name = "incise")]
fn fill(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<mesh::Mesh>()?;
    module.add_class::<body::Body>()?;
    module.add_class::<simulation::Simulation>()?;
    module.add_class::<surface::Surface>()?;
    module.add_class::<snapshot::Snapshot>()?;
    module.add_class::<handles::Grab>()?;
    module.add_class::<handles::Collider>()?;
    module.add_class::<handles::Attachment>()?;
    module.add_class::<handles::Distance>()?;
    module.add_class::<scheduling::Coloring>()?;
    module.add_class::<scheduling::Clustering>()?;
    module.add_function(wrap_pyfunction!(scheduling::color, module)?)?;
    module.add_function(wrap_pyfunction!(scheduling::cluster, module)?)?;
    module.add_function(wrap_pyfunction!(scene::advise, module)?)?;
    module.add_function(wrap_pyfunction!(scene::load_scene, module)?)?;
    module.add_function(wrap_pyfunction!(scene::built_in_scene, module)?)?;
    module.add_function(wrap_pyfunction!(scene::scene_to_toml, module)?)?;
    Ok(())
}
