//! `incise mesh`: looks at, converts and generates meshes.

use std::path::Path;

use anyhow::Context;
use comfy_table::Table;
use comfy_table::presets::UTF8_FULL_CONDENSED;
use incise::mesh::generate::{Shape, generate};
use incise::mesh::{TetMesh, io};
use serde::Serialize;

use crate::args::MeshCommand;
use crate::failure::Failure;
use crate::print::print;

/// The object that `incise mesh info --json` prints.
#[derive(Debug, Serialize)]
struct MeshReport {
    input: String,
    tets: usize,
    particles: usize,
    pieces: usize,
    boundary_triangles: usize,
    euler_characteristic: isize,
    volume: f64,
    min_altitude: f64,
    min_dihedral_degrees: f64,
    max_dihedral_degrees: f64,
    worst_radius_ratio: f64,
    max_tets_per_particle: usize,
}

pub(crate) fn mesh(command: &MeshCommand) -> Result<(), Failure> {
    match command {
        MeshCommand::Info { file, json } => info(file, *json),
        MeshCommand::Convert { input, output } => Ok(io::write(output, &io::read(input)?)?),
        MeshCommand::Generate {
            shape,
            tets,
            output,
        } => Ok(io::write(
            output,
            &generate(Shape::from_name(shape)?, *tets)?,
        )?),
    }
}

fn info(file: &Path, json: bool) -> Result<(), Failure> {
    let mesh = io::read(file)?;
    mesh.check()
        .with_context(|| file.display().to_string())
        .map_err(Failure::Input)?;
    let report = report(file, &mesh);
    if json {
        let json = serde_json::to_string(&report).map_err(|error| Failure::Run(error.into()))?;
        print(json)?;
    } else {
        print(table(&report))?;
    }
    Ok(())
}

fn report(file: &Path, mesh: &TetMesh) -> MeshReport {
    let (quality, surface) = (mesh.quality(), mesh.surface());
    MeshReport {
        input: file.display().to_string(),
        tets: mesh.tets.len(),
        particles: mesh.positions.len(),
        pieces: mesh.pieces().count,
        boundary_triangles: surface.triangles.len(),
        euler_characteristic: surface.euler_characteristic(),
        volume: mesh.total_volume(),
        min_altitude: quality.min_altitude,
        min_dihedral_degrees: quality.min_dihedral,
        max_dihedral_degrees: quality.max_dihedral,
        worst_radius_ratio: quality.worst_radius_ratio,
        max_tets_per_particle: quality.max_tets_at_particle,
    }
}

fn table(report: &MeshReport) -> Table {
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED);
    table.set_header([report.input.as_str(), "sound"]);
    let mut row = |name: &str, value: String| {
        table.add_row([name.to_owned(), value]);
    };
    row(
        "tets, particles",
        format!("{}, {}", report.tets, report.particles),
    );
    row("pieces", report.pieces.to_string());
    row(
        "boundary triangles, Euler characteristic",
        format!(
            "{}, {}",
            report.boundary_triangles, report.euler_characteristic
        ),
    );
    row("volume in m³", format!("{:.6}", report.volume));
    row(
        "smallest altitude in m",
        format!("{:.3e}", report.min_altitude),
    );
    row(
        "dihedral angles",
        format!(
            "{:.1}° to {:.1}°",
            report.min_dihedral_degrees, report.max_dihedral_degrees
        ),
    );
    row(
        "worst radius ratio",
        format!("{:.3}", report.worst_radius_ratio),
    );
    row(
        "most tets at a particle",
        report.max_tets_per_particle.to_string(),
    );
    table
}
