//! `incise mesh`: looks at, converts and generates meshes.

use std::path::Path;

use anyhow::Context;
use comfy_table::Table;
use comfy_table::presets::UTF8_FULL_CONDENSED;
use incise::mesh::{RepairOptions, TetMesh, TriangleSurface, repair};
use incise::mesh_io;
use incise::meshing::{Shape, Solid, generate, tetrahedralize};
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
    /// Handles of all boundary surfaces; absent if they are no manifolds.
    #[serde(skip_serializing_if = "Option::is_none")]
    genus: Option<usize>,
    /// That bring the kappa of every tet to 0.5.
    substeps: f64,
    /// Angles in classes of 10 degrees from 0 to 180.
    dihedral_histogram: [usize; 18],
    /// Tets in classes of a tenth from 0 to 1.
    radius_ratio_histogram: [usize; 10],
}

/// The material and the frame whose substeps are told.
struct Stiffness {
    young_modulus: f64,
    density: f64,
    time_step: f64,
}

impl Stiffness {
    /// The substeps of a frame that keep `E Δt² / (ρ h²)` at 0.5 or below for an altitude h in m.
    fn substeps(&self, altitude: f64) -> f64 {
        let speed = (self.young_modulus / (0.5 * self.density)).sqrt();
        (self.time_step * speed / altitude).ceil().max(1.0)
    }

    fn check(&self) -> Result<(), Failure> {
        for (name, value) in [
            ("--young-modulus", self.young_modulus),
            ("--density", self.density),
            ("--time-step", self.time_step),
        ] {
            if !(value.is_finite() && value > 0.0) {
                let message = format!("{name} is {value}: it must be positive and finite");
                return Err(Failure::Input(anyhow::Error::msg(message)));
            }
        }
        Ok(())
    }
}

pub(crate) fn mesh(command: &MeshCommand) -> Result<(), Failure> {
    match command {
        MeshCommand::Info {
            file,
            json,
            young_modulus,
            density,
            time_step,
        } => {
            let stiffness = Stiffness {
                young_modulus: *young_modulus,
                density: *density,
                time_step: *time_step,
            };
            stiffness.check()?;
            info(file, *json, &stiffness)
        }
        MeshCommand::Convert {
            input,
            output,
            repair: wanted,
        } => {
            let mut file = mesh_io::read_file(input)?;
            let mut report = None;
            if *wanted {
                let repaired = repair(&file.mesh, &RepairOptions::ALL);
                report = Some(repaired.report);
                file = file.repaired(repaired);
            }
            if mesh_io::is_surface(output) {
                mesh_io::write_surface(output, &TriangleSurface::boundary_of(&file.mesh))?;
            } else {
                mesh_io::write_file(output, &file)?;
            }
            report.map_or(Ok(()), print)
        }
        MeshCommand::Tetrahedralize {
            surface,
            output,
            tets,
            levels,
        } => fill(surface, output, *tets, *levels),
        MeshCommand::Generate {
            shape,
            tets,
            output,
        } => Ok(mesh_io::write(
            output,
            &generate(Shape::from_name(shape)?, *tets)?,
        )?),
    }
}

/// Fills a surface, and says how well the body fits it.
fn fill(file: &Path, output: &Path, tets: usize, levels: u32) -> Result<(), Failure> {
    let surface = mesh_io::read_surface(file)?;
    let named = |error| {
        let error = anyhow::Error::new(error).context(file.display().to_string());
        Failure::Input(error)
    };
    let solid = Solid::new(&surface).map_err(named)?;
    let mesh = tetrahedralize(&solid, tets, levels).map_err(named)?;
    mesh_io::write(output, &mesh)?;
    let boundary = TriangleSurface::boundary_of(&mesh);
    let back = Solid::new(&boundary).map_err(named)?;
    let prepared = solid.prepared();
    for (count, what) in [
        (
            prepared.welded,
            "points at the place of another were merged",
        ),
        (
            prepared.degenerate,
            "triangles with equal corners were left out",
        ),
        (
            prepared.turned,
            "triangles were turned to face as their neighbors",
        ),
    ] {
        if count > 0 {
            print(format!("{count} {what}"))?;
        }
    }
    if prepared.inside_out {
        print("the surface was inside out and was turned")?;
    }
    print(format!(
        "tets {}, particles {}, pieces {}",
        mesh.tets.len(),
        mesh.positions.len(),
        mesh.pieces().count
    ))?;
    print(format!(
        "volume {:.6} m³, that of the surface is {:.6} m³",
        mesh.total_volume(),
        solid.volume()
    ))?;
    print(format!(
        "the body reaches {:.3e} m beyond or short of the surface, the surface {:.3e} m from the body; a tet is {:.3e} m wide",
        solid.farthest(&boundary),
        back.farthest(&surface),
        (12.0 * mesh.total_volume() / mesh.tets.len() as f64).cbrt()
    ))
}

fn info(file: &Path, json: bool, stiffness: &Stiffness) -> Result<(), Failure> {
    let mesh = mesh_io::read(file)?;
    mesh.check()
        .with_context(|| file.display().to_string())
        .map_err(Failure::Input)?;
    let report = report(file, &mesh, stiffness);
    if json {
        let json = serde_json::to_string(&report).map_err(|error| Failure::Run(error.into()))?;
        print(json)?;
    } else {
        print(table(&report))?;
        let angles = report.dihedral_histogram.iter().enumerate();
        print(bars(
            "dihedral angles",
            angles.map(|(i, &n)| (format!("{}° to {}°", 10 * i, 10 * (i + 1)), n)),
        ))?;
        let ratios = report.radius_ratio_histogram.iter().enumerate();
        print(bars(
            "radius ratios",
            ratios.map(|(i, &n)| (format!("0.{i} to {}.{}", (i + 1) / 10, (i + 1) % 10), n)),
        ))?;
    }
    Ok(())
}

/// Characters of the longest bar.
const BAR: usize = 40;

/// A histogram as bars, without the empty classes outside of all others.
fn bars(title: &str, classes: impl Iterator<Item = (String, usize)>) -> Table {
    let classes: Vec<_> = classes.collect();
    let first = classes.iter().position(|(_, n)| *n > 0).unwrap_or(0);
    let last = classes.iter().rposition(|(_, n)| *n > 0).unwrap_or(0);
    let most = classes.iter().map(|(_, n)| *n).max().unwrap_or(0).max(1);
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED);
    table.set_header([title, "number", ""]);
    for (name, number) in &classes[first..=last] {
        // Few are seen, too.
        let length = (number * BAR).div_ceil(most);
        table.add_row([name.clone(), number.to_string(), "█".repeat(length)]);
    }
    table
}

fn report(file: &Path, mesh: &TetMesh, stiffness: &Stiffness) -> MeshReport {
    let (quality, surface) = (mesh.quality(), mesh.surface());
    let histograms = mesh.histograms();
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
        genus: surface.genus(),
        substeps: stiffness.substeps(quality.min_altitude),
        dihedral_histogram: histograms.dihedral,
        radius_ratio_histogram: histograms.radius_ratio,
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
    if let Some(genus) = report.genus {
        row("genus", genus.to_string());
    }
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
    row("substeps for the material", report.substeps.to_string());
    table
}
