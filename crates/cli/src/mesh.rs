//! `incise mesh`: inspects, converts and generates meshes.

use std::path::Path;
use std::time::Duration;

use anyhow::Context;
use comfy_table::Table;
use comfy_table::presets::UTF8_FULL_CONDENSED;
use incise::mesh::glam::{DVec2, DVec3};
use incise::mesh::{Pieces, RepairOptions, TetMesh, TriangleSurface, closest_on_triangle, repair};
use incise::mesh_io::{self, MeshFile, NamedValues, OwnedValues, SurfaceFile};
use incise::meshing::{MeshingError, Shape, Solid, generate, tetrahedralize_with};
use indicatif::{ProgressBar, ProgressStyle};
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
        } => convert(input, output, *wanted),
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
        } => {
            let mesh = generate(Shape::from_name(shape)?, *tets)?;
            write(output, &MeshFile::from(mesh))
        }
    }
}

/// Converts a mesh or a surface; the boundary of a mesh is a surface.
fn convert(input: &Path, output: &Path, repaired: bool) -> Result<(), Failure> {
    let (from, to) = (input.display(), output.display());
    if mesh_io::is_surface(input) {
        let why = if mesh_io::is_mesh(output) {
            format!(
                "{from} is a surface, and {to} is a mesh of tets: fill it by \
                 `incise mesh tetrahedralize {from} {to} --tets 20000`"
            )
        } else if repaired {
            format!("--repair is for meshes of tets, and {from} is a surface: omit it")
        } else {
            let file = mesh_io::read_surface_file(input)?;
            return Ok(mesh_io::write_surface_file(output, &file)?);
        };
        return Err(Failure::Input(anyhow::Error::msg(why)));
    }
    let mut file = mesh_io::read_file(input)?;
    let mut report = None;
    if repaired {
        let repaired = repair(&file.mesh, &RepairOptions::ALL);
        report = Some(repaired.report);
        file = file.repaired(repaired);
    }
    write(output, &file)?;
    report.map_or(Ok(()), print)
}

/// Writes a mesh, or its boundary if the format is that of a surface.
fn write(output: &Path, file: &MeshFile) -> Result<(), Failure> {
    if mesh_io::is_surface(output) {
        let surface = TriangleSurface::boundary_of(&file.mesh).without_unused();
        return Ok(mesh_io::write_surface(output, &surface)?);
    }
    Ok(mesh_io::write_file(output, file)?)
}

/// Prints a warning to stderr.
#[expect(clippy::print_stderr, reason = "warnings go to stderr")]
fn warn(message: &str) {
    eprintln!("warning: {message}");
}

/// Fills a surface and prints the deviation of the body from it.
fn fill(path: &Path, output: &Path, tets: usize, levels: u32) -> Result<(), Failure> {
    if !(mesh_io::is_mesh(output) || mesh_io::is_surface(output)) {
        // Names the known formats before minutes are spent.
        mesh_io::write_file(output, &MeshFile::default())?;
    }
    let file = mesh_io::read_surface_file(path)?;
    let surface = &file.surface;
    let named = |error| {
        let error = anyhow::Error::new(error).context(path.display().to_string());
        Failure::Input(error)
    };
    let solid = Solid::new(surface).map_err(named)?;
    let mesh = with_progress(&solid, tets, levels).map_err(named)?;
    let boundary = TriangleSurface::boundary_of(&mesh);
    let mut filled = MeshFile::from(mesh);
    if let Some(texture) = texture(&file, &solid, &filled.mesh) {
        filled.particles.push(texture);
    }
    write(output, &filled)?;
    let mesh = &filled.mesh;
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
    let pieces = mesh.pieces();
    print(format!(
        "{}, {}, {}",
        count(mesh.tets.len(), "tet", "tets"),
        count(mesh.positions.len(), "particle", "particles"),
        count(pieces.count, "piece", "pieces"),
    ))?;
    print(format!(
        "volume {:.6} m³ (surface: {:.6} m³)",
        mesh.total_volume(),
        solid.volume()
    ))?;
    let size = (12.0 * mesh.total_volume() / mesh.tets.len() as f64).cbrt();
    print(format!(
        "distance of the body from the surface: at most {:.2e} m (size of a tet: {size:.2e} m)",
        solid.farthest(&boundary),
    ))?;
    let (place, missed) = back.farthest_point(surface);
    if missed > size {
        warn(&format!(
            "parts of the surface up to {missed:.2e} m away are not covered, the farthest at {} (thinner than a tet, \
             {size:.2e} m); increase --tets",
            coordinates(place)
        ));
    }
    if pieces.count > prepared.shells {
        warn(&format!(
            "the body has {}, the surface has {}: the smallest piece is at {}; increase --tets",
            count(pieces.count, "piece", "pieces"),
            count(prepared.shells, "part", "parts"),
            coordinates(smallest_piece(mesh, &pieces))
        ));
    }
    Ok(())
}

/// Fills the solid, with a bar on a terminal.
fn with_progress(solid: &Solid, tets: usize, levels: u32) -> Result<TetMesh, MeshingError> {
    let template = "{spinner} lattice {pos} of at most {len}  {msg}  {elapsed}";
    let style = ProgressStyle::with_template(template);
    let bar =
        ProgressBar::new(1).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(200));
    let filled = tetrahedralize_with(solid, tets, levels, &mut |attempt| {
        bar.set_length(u64::from(attempt.lattices));
        bar.set_position(u64::from(attempt.lattice) + 1);
        bar.set_message(format!(
            "{} tets at a spacing of {:.2e} m",
            attempt.tets, attempt.spacing
        ));
    });
    bar.finish_and_clear();
    filled
}

/// Texture coordinates of the particles of a body, those of the nearest points of the surface; `None` without a texture.
fn texture(file: &SurfaceFile, solid: &Solid, mesh: &TetMesh) -> Option<NamedValues> {
    if file.texture_corners.is_empty() {
        return None;
    }
    let of_point = |point: &DVec3| {
        let triangle = solid.nearest_triangle(*point);
        let corners = file.surface.triangles[triangle].map(|p| file.surface.positions[p.index()]);
        let weights = closest_on_triangle(corners, *point).weights;
        let pairs = file.texture_of(triangle)?;
        let sum: DVec2 = pairs
            .into_iter()
            .zip(weights)
            .map(|(pair, w)| w * pair)
            .sum();
        Some(sum.extend(0.0))
    };
    let values: Option<Vec<DVec3>> = mesh.positions.iter().map(of_point).collect();
    Some(NamedValues {
        name: "texture_coordinates".to_owned(),
        values: OwnedValues::Vectors(values?),
    })
}

/// Center of the piece with the fewest tets, the mean of its tets' corners.
fn smallest_piece(mesh: &TetMesh, pieces: &Pieces) -> DVec3 {
    let mut counts = vec![0_usize; pieces.count];
    let mut sums = vec![DVec3::ZERO; pieces.count];
    for (tet, &piece) in mesh.tets.iter().zip(&pieces.labels) {
        counts[piece as usize] += 1;
        let corners = tet.iter().map(|p| mesh.positions[p.index()]);
        sums[piece as usize] += corners.sum::<DVec3>() / 4.0;
    }
    let smallest = (0..pieces.count).min_by_key(|&piece| counts[piece]);
    smallest.map_or(DVec3::ZERO, |piece| sums[piece] / counts[piece] as f64)
}

/// A point in three digits.
fn coordinates(point: DVec3) -> String {
    let [x, y, z] = point.to_array();
    format!("({x:.3}, {y:.3}, {z:.3})")
}

/// JSON object printed by `incise mesh info --json` for a surface.
#[derive(Debug, Serialize)]
struct SurfaceReport {
    input: String,
    triangles: usize,
    points: usize,
    texture_coordinates: bool,
    area: f64,
    low: [f64; 3],
    high: [f64; 3],
    /// Whether the surface encloses a volume, so that it can be filled.
    closed: bool,
    /// The reason if not.
    #[serde(skip_serializing_if = "Option::is_none")]
    fault: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    parts: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    volume: Option<f64>,
}

/// Prints what a surface is, and whether it can be filled.
fn surface_info(path: &Path, json: bool) -> Result<(), Failure> {
    let file = mesh_io::read_surface_file(path)?;
    let surface = &file.surface;
    let solid = Solid::new(surface);
    let corners = || {
        surface
            .triangles
            .iter()
            .flatten()
            .map(|p| surface.positions[p.index()])
    };
    let areas = surface.triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(|p| surface.positions[p.index()]);
        0.5 * (b - a).cross(c - a).length()
    });
    let report = SurfaceReport {
        input: path.display().to_string(),
        triangles: surface.triangles.len(),
        points: surface.positions.len(),
        texture_coordinates: !file.texture_corners.is_empty(),
        area: areas.sum(),
        low: corners().fold(DVec3::INFINITY, DVec3::min).to_array(),
        high: corners().fold(DVec3::NEG_INFINITY, DVec3::max).to_array(),
        closed: solid.is_ok(),
        fault: solid.as_ref().err().map(ToString::to_string),
        parts: solid.as_ref().ok().map(|solid| solid.prepared().shells),
        volume: solid.as_ref().ok().map(Solid::volume),
    };
    if json {
        let json = serde_json::to_string(&report).map_err(|error| Failure::Run(error.into()))?;
        return print(json);
    }
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED);
    table.set_header([report.input.as_str(), "surface of triangles"]);
    let mut row = |name: &str, value: String| {
        table.add_row([name.to_owned(), value]);
    };
    row("triangles", report.triangles.to_string());
    row("points", report.points.to_string());
    let texture = if report.texture_coordinates {
        "yes"
    } else {
        "no"
    };
    row("texture coordinates", texture.to_owned());
    row("area", format!("{:.6} m²", report.area));
    let [low, high] =
        [report.low, report.high].map(|corner| coordinates(DVec3::from_array(corner)));
    row("bounding box", format!("{low} to {high} m"));
    if let (Some(parts), Some(volume)) = (report.parts, report.volume) {
        row("parts", parts.to_string());
        row("volume", format!("{volume:.6} m³"));
    }
    print(table)?;
    print(match &report.fault {
        None => format!(
            "fill it with tets: incise mesh tetrahedralize {} OUT.vtk --tets 20000",
            report.input
        ),
        Some(fault) => fault.clone(),
    })
}

fn info(file: &Path, json: bool, stiffness: &Stiffness) -> Result<(), Failure> {
    if mesh_io::is_surface(file) {
        return surface_info(file, json);
    }
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
