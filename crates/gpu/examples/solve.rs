//! A ball hangs from its upper half and sags, solved on a GPU; prints a note if there is none.
//!
//! `cargo run --release -p incise-gpu --example solve`

#![expect(clippy::print_stdout, reason = "prints what it did")]

use std::sync::Arc;

use glam::DVec3;
use incise_clustering::{Method, cluster};
use incise_gpu::coloring::{ColoringKernels, DeviceIncidence, scgc_incidence};
use incise_gpu::{ClusterMapping, GpuContext, GpuError, GpuOptions, GpuSolver};
use incise_graph::{Incidence, Schedule};
use incise_mesh::TetId;
use incise_meshing::{Shape, generate};
use incise_xpbd::{Material, Solver, StepSettings};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let gpu = match GpuContext::new(&GpuOptions::from_env()) {
        Err(GpuError::NoAdapter { .. }) => {
            println!(
                "there is no GPU: `Solver::step` of incise-xpbd does the same on the processor"
            );
            return Ok(());
        }
        other => Arc::new(other?),
    };
    let mesh = generate(Shape::Sphere, 500)?;
    let mut solver = Solver::<f32>::new(&mesh.positions);
    solver.add_material(Material {
        young_modulus: 1e5,
        poisson_ratio: 0.45,
        density: 1000.0,
        damping: 0.0,
    })?;
    for (t, tet) in mesh.tets.iter().enumerate() {
        solver.push_tet(tet.map(|p| p.0), mesh.corners(TetId::new(t)), 0);
    }
    for (p, x) in mesh.positions.iter().enumerate() {
        solver.set_mass(p, 1.0);
        solver.set_fixed(p, x.z > 0.0);
    }

    // Tets into clusters on the processor, clusters into colors on the device.
    let tets = Incidence::from_constraints(mesh.positions.len(), mesh.tets.iter().copied())?;
    let clusters = cluster("serial:10".parse::<Method>()?, &tets);
    let there = DeviceIncidence::new(&gpu, &tets.quotient(&clusters))?;
    let colors = scgc_incidence(&gpu, &mut ColoringKernels::default(), &there)?.read(&gpu)?;
    let schedule = Schedule::new(&clusters, &colors);
    println!(
        "{} tets in {} colors",
        tets.constraint_count(),
        schedule.color_count()
    );

    let settings = StepSettings {
        substeps: 10,
        gravity: Some(DVec3::new(0.0, 0.0, -9.81)),
        ..StepSettings::new(0.01)
    };
    let mut body = GpuSolver::new(gpu, solver, ClusterMapping::Threads)?;
    for frame in 1..=20 {
        body.step(&schedule, &settings)?; // returns at once
        if frame % 5 == 0 {
            let host = body.host()?; // waits for the device
            let heights = (0..host.particle_count()).map(|p| host.position(p).z);
            let lowest = heights.fold(f64::INFINITY, f64::min);
            println!("frame {frame:2}: the lowest particle is at {lowest:.4} m");
        }
    }
    Ok(())
}
