//! `incise mesh`: inspects, converts and generates meshes.

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
use crate::print::{count, print};

/// JSON object printed by `incise mesh info --json`.
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
    /// Genus of all boundary surfaces; absent if they are not manifolds.
    #[serde(skip_serializing_if = "Option::is_none")]
    genus: Option<usize>,
    /// Substeps that bring the kappa of every tet to 0.5.
    substeps: f64,
    /// Histogram of dihedral angles in bins of 10 degrees from 0 to 180.
    dihedral_histogram: [usize; 18],
    /// Histogram of radius ratios in bins of a tenth from 0 to 1.
    radius_ratio_histogram: [usize; 10],
}

/// Material and frame time for the number of substeps.
struct Stiffness {
    young_modulus: f64,
    density: f64,
    time_step: f64,
}

impl Stiffness {
    /// Number of substeps that keeps `E Δt² / (ρ h²)` at 0.5 or below for an altitude h in m.
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

/// Fills a surface and prints the deviation of the body from it.
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
    for (number, what, done) in [
        (prepared.welded, "coincident point", "merged"),
        (prepared.degenerate, "degenerate triangle", "removed"),
        (
            prepared.turned,
            "triangle",
            "reoriented to match the neighbors",
        ),
    ] {
        if number > 0 {
            print(format!(
                "{} {done}",
                count(number, what, &format!("{what}s"))
            ))?;
        }
    }
    if prepared.inside_out {
        print("the surface was inside out; all triangles were reversed")?;
    }
    print(format!(
        "{}, {}, {}",
        count(mesh.tets.len(), "tet", "tets"),
        count(mesh.positions.len(), "particle", "particles"),
        count(mesh.pieces().count, "piece", "pieces"),
    ))?;
    print(format!(
        "volume {:.6} m³ (surface: {:.6} m³)",
        mesh.total_volume(),
        solid.volume()
    ))?;
    let size = (12.0 * mesh.total_volume() / mesh.tets.len() as f64).cbrt();
    let missed = back.farthest(&surface);
    print(format!(
        "distance of the body from the surface: at most {:.2e} m (size of a tet: {size:.2e} m)",
        solid.farthest(&boundary),
    ))?;
    if missed > size {
        print(format!(
            "warning: parts of the surface up to {missed:.2e} m away are not covered (thinner than a tet, {size:.2e} m); \
             increase --tets"
        ))?;
    }
    Ok(())
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

/// Length of the longest bar in characters.
const BAR: usize = 40;

/// Histogram as bars, without empty bins at both ends.
fn bars(title: &str, classes: impl Iterator<Item = (String, usize)>) -> Table {
    let classes: Vec<_> = classes.collect();
    let first = classes.iter().position(|(_, n)| *n > 0).unwrap_or(0);
    let last = classes.iter().rposition(|(_, n)| *n > 0).unwrap_or(0);
    let most = classes.iter().map(|(_, n)| *n).max().unwrap_or(0).max(1);
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED);
    table.set_header([title, "count", ""]);
    for (name, number) in &classes[first..=last] {
        // Rounded up so that small counts get a visible bar.
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
    table.set_header([report.input.as_str(), "valid"]);
    let mut row = |name: &str, value: String| {
        table.add_row([name.to_owned(), value]);
    };
    row("tets", report.tets.to_string());
    row("particles", report.particles.to_string());
    row("pieces", report.pieces.to_string());
    row("boundary triangles", report.boundary_triangles.to_string());
    row(
        "Euler characteristic",
        report.euler_characteristic.to_string(),
    );
    if let Some(genus) = report.genus {
        row("genus", genus.to_string());
    }
    row("volume", format!("{:.6} m³", report.volume));
    row(
        "smallest altitude",
        format!("{:.3e} m", report.min_altitude),
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
        "largest number of tets at a particle",
        report.max_tets_per_particle.to_string(),
    );
    row("substeps for kappa 0.5", report.substeps.to_string());
    table
}
