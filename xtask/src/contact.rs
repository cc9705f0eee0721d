//! `cargo xtask contact`: what contact costs and how deep it gets, beside the figures that it aims at.
//!
//! Costs: a liver that is cut in two, with contact and without, frame by frame in turn, so that other load of the machine
//! affects both alike. The share of contact is what the frame takes longer, the solver's passes included. The two run over
//! the same tets but not over the same motion, because without contact the parts pass through each other.
//!
//! Sliding: a soft block that is cut into ten slices while it falls, where nearly every vertex moves.
//!
//! Depths: stacks of cubes, and a pile of organs in a box, in percent of the mean edge; with `--python` in two other systems,
//! too.

mod peers;

use std::path::PathBuf;

use clap::Args;
use incise::mesh::glam::{DVec3, dvec3};
use incise::mesh::{TetMesh, kuhn_box};
use incise::meshing::{Shape, generate};
use incise::scene::{BodySpec, ContactSpec, Method, Precision, SolverSpec, StrokeSpec};
use incise::{Body, FrameReport, Simulation, SimulationBuilder};
use serde::{Deserialize, Serialize};

use self::peers::{End, Plane, Scene};
use crate::experiment::{Cell, Experiment, ExperimentArguments, Page, Part, Table, median};

/// Substeps of a frame of a liver.
const SUBSTEPS: u32 = 30;
/// Tets of the liver.
const TETS: usize = 11_000;
/// Largest share of a frame that pairs across a fresh cut should take, and that all contact should.
const SHARES: [f64; 2] = [0.05, 0.25];
/// Largest depth in mean edges of a body at rest on itself, of a stack, and of a pile.
const DEPTHS: [f64; 3] = [0.01, 0.001, 0.1];

/// A measurement.
#[derive(Clone, Debug, Serialize, Deserialize)]
enum Row {
    Cost(Cost),
    Slices(Slices),
    Depth(Depth),
    End(End),
}

#[derive(Debug, Args)]
pub(crate) struct ContactArguments {
    #[command(flatten)]
    experiment: ExperimentArguments,
    /// Run stacks and a pile in other systems as well, with this Python; it needs the packages pbatoolkit and newton.
    #[arg(long, value_name = "FILE")]
    python: Option<PathBuf>,
}

/// What contact costs in a scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Cost {
    scene: String,
    threads: usize,
    tets: usize,
    candidates: usize,
    active: usize,
    colors: usize,
    /// Median of a frame without contact and with it, in ms.
    ms: [f64; 2],
    /// Median and mean of what finding and coloring takes, in ms.
    find_ms: [f64; 2],
    /// The frame of the cut, without contact and with it, in ms.
    cut_ms: [f64; 2],
    /// The slowest frame of all with contact, in ms.
    worst_ms: f64,
    /// Largest depth of the measured frames, and the largest 99th percentile, in mean edges.
    depths: [f64; 2],
    buried: usize,
}

impl Cost {
    fn share(&self) -> f64 {
        1.0 - self.ms[0] / self.ms[1]
    }
}

/// What contact costs among slices that slide.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Slices {
    young_modulus: f64,
    tets: usize,
    active: usize,
    /// Mean, median and largest of what finding and coloring takes, in ms.
    find_ms: [f64; 3],
    /// Mean of a frame, in ms.
    ms: f64,
    /// Largest depth of a frame: mean and largest; and the mean of the 99th percentile. In mean edges.
    depths: [f64; 3],
    buried: usize,
}

/// How deep bodies at rest are in each other.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Depth {
    scene: String,
    tets: usize,
    active: usize,
    /// Largest depth of the last frames, and the largest 99th percentile, in mean edges.
    depths: [f64; 2],
    /// Largest depth before, in mean edges.
    deepest: f64,
    buried: usize,
    repaired: usize,
}

/// Runs this experiment as part of `all`, without other systems.
pub(crate) fn usual(arguments: &ExperimentArguments) -> anyhow::Result<()> {
    run(&ContactArguments {
        experiment: arguments.clone(),
        python: None,
    })
}

/// Measures and writes the page.
pub(crate) fn run(arguments: &ContactArguments) -> anyhow::Result<()> {
    let quick = arguments.experiment.quick;
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let mut threads = vec![1, all];
    threads.dedup();
    let mut cells = Vec::new();
    for threads in threads {
        for lies in [false, true] {
            let id = format!("{}-{threads}", if lies { "lies" } else { "pairs" });
            cells.push(Cell::new(id, move || {
                cost(lies, threads, quick).map(Row::Cost)
            }));
        }
    }
    for young_modulus in [3e3, 3e4] {
        let id = format!("slices-{young_modulus}");
        cells.push(Cell::new(id, move || {
            slices(young_modulus, quick).map(Row::Slices)
        }));
    }
    for count in [2, 5, 10] {
        cells.push(Cell::new(format!("stack-{count}"), move || {
            depth(&stack(count, quick)?).map(Row::Depth)
        }));
    }
    cells.push(Cell::new("pile", move || {
        depth(&pile(quick)?).map(Row::Depth)
    }));
    if let Some(python) = &arguments.python {
        let scenes: [(&str, MakeScene); 4] = [
            ("stack-2", |quick| stack(2, quick)),
            ("stack-5", |quick| stack(5, quick)),
            ("stack-10", |quick| stack(10, quick)),
            ("pile", pile),
        ];
        for (name, make) in scenes {
            cells.push(Cell::new(format!("incise-{name}"), move || {
                peers::ours(&make(quick)?).map(Row::End)
            }));
            for peer in peers::PEERS {
                let python = python.clone();
                cells.push(Cell::new(format!("{}-{name}", peer.id), move || {
                    Ok(Row::End(peers::run(&peer, &make(quick)?, &python)))
                }));
            }
        }
    }
    let experiment = Experiment {
        name: "contact",
        cells,
        page,
    };
    experiment.run(&arguments.experiment)
}

fn solver(substeps: u32) -> SolverSpec {
    SolverSpec::default().with(|spec| {
        spec.precision = Precision::F32;
        spec.substeps = substeps.into();
        spec.method = Method::GaussSeidel;
    })
}

/// A liver of 25 cm that a plane cuts: lying on the ground with one part on the other, or at rest without a load.
fn liver(lies: bool, tets: usize, contact: bool) -> anyhow::Result<SimulationBuilder> {
    let mut builder = Simulation::builder();
    builder.solver(solver(SUBSTEPS));
    let body = Body::new(generate(Shape::Liver, tets)?).scale(0.25);
    builder.add_body(body.young_modulus(3e4).density(1050.0).damping(0.005));
    if lies {
        builder.gravity(DVec3::NEG_Z * 9.81).ground(-0.1, 0.8);
    }
    if contact {
        builder.contact(ContactSpec::default().with(|spec| spec.friction = 0.5));
    }
    let frame = if lies { 40 } else { 4 };
    let height = if lies { -0.05 } else { 0.0 };
    let plane = StrokeSpec::plane(frame, [0.0, 0.0, height], [0.1, 0.05, 1.0]);
    builder.add_stroke(plane);
    Ok(builder)
}

/// Runs a liver with contact and without in turn.
fn cost(lies: bool, threads: usize, quick: bool) -> anyhow::Result<Cost> {
    let tets = if quick { 500 } else { TETS };
    let (settle, measured) = match (lies, quick) {
        (_, true) => (45, 3),
        (true, false) => (120, 60),
        (false, false) => (8, 60),
    };
    let mut both = Vec::new();
    for contact in [false, true] {
        let mut builder = liver(lies, tets, contact)?;
        builder.threads(threads);
        both.push((builder.build()?, Vec::<FrameReport>::new()));
    }
    for _ in 0..settle + measured {
        for (simulation, reports) in &mut both {
            reports.push(simulation.step()?.clone());
        }
    }
    let cut_ms = [0, 1].map(|run| {
        let cuts = both[run].1.iter().filter(|report| report.cut.is_some());
        cuts.map(|report| report.ms.total).fold(0.0, f64::max)
    });
    let ms = [0, 1].map(|run| median(both[run].1[settle..].iter().map(|report| report.ms.total)));
    let with = &both[1].1;
    let last = &with[settle..];
    let contacts = || last.iter().filter_map(|report| report.contact);
    let most = |of: fn(&incise::report::ContactReport) -> f64| {
        contacts().map(|contact| of(&contact)).fold(0.0, f64::max)
    };
    let end = contacts().next_back().unwrap_or_default();
    Ok(Cost {
        scene: if lies {
            "upper part lies on the lower".to_owned()
        } else {
            "fresh cut without load".to_owned()
        },
        threads,
        tets: both[1].0.mesh().tets.len(),
        candidates: end.candidates,
        active: end.active,
        colors: end.colors,
        ms,
        find_ms: [
            median(last.iter().map(|report| report.ms.contact)),
            mean(last.iter().map(|report| report.ms.contact)),
        ],
        cut_ms,
        worst_ms: with
            .iter()
            .map(|report| report.ms.total)
            .fold(0.0, f64::max),
        depths: [most(|c| c.max_depth), most(|c| c.depth_p99)],
        buried: end.buried,
    })
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

/// Cuts a block of 10 cm into ten slices while it falls on the ground, on one thread.
fn slices(young_modulus: f64, quick: bool) -> anyhow::Result<Slices> {
    let (tets, measured) = if quick { (300, 3) } else { (9_000, 120) };
    let mesh = generate(Shape::Box, tets)?;
    let ends = (DVec3::MAX, DVec3::MIN);
    let fold = |(low, high): (DVec3, DVec3), x: &DVec3| (low.min(*x), high.max(*x));
    let (low, high) = mesh.positions.iter().fold(ends, fold);
    let scale = 0.1 / (high.z - low.z);
    let mut builder = Simulation::builder();
    builder
        .gravity(DVec3::NEG_Z * 9.81)
        .ground(0.0, 0.5)
        .solver(solver(20))
        .threads(1);
    let body = Body::new(mesh)
        .scale(scale)
        .position(dvec3(0.0, 0.0, 0.002 - low.z * scale));
    builder.add_body(
        body.young_modulus(young_modulus)
            .density(1000.0)
            .damping(0.01),
    );
    builder.contact(ContactSpec::default().with(|spec| spec.friction = 0.4));
    for number in 1..10_u32 {
        let x = (low.x + (high.x - low.x) * f64::from(number) / 10.0) * scale;
        let frame = u64::from(3 + 2 * number);
        builder.add_stroke(StrokeSpec::plane(frame, [x, 0.0, 0.0], [1.0, 0.05, 0.02]));
    }
    let mut simulation = builder.build()?;
    let mut reports = Vec::new();
    for _ in 0..30 + measured {
        reports.push(simulation.step()?.clone());
    }
    let last = &reports[30..];
    let find = || last.iter().map(|report| report.ms.contact);
    let contacts: Vec<_> = last.iter().filter_map(|report| report.contact).collect();
    let deepest = || contacts.iter().map(|contact| contact.max_depth);
    let end = simulation.report().contact.unwrap_or_default();
    Ok(Slices {
        young_modulus,
        tets: simulation.mesh().tets.len(),
        active: end.active,
        find_ms: [mean(find()), median(find()), find().fold(0.0, f64::max)],
        ms: mean(last.iter().map(|report| report.ms.total)),
        depths: [
            mean(deepest()),
            deepest().fold(0.0, f64::max),
            mean(contacts.iter().map(|contact| contact.depth_p99)),
        ],
        buried: end.buried,
    })
}

/// A mesh moved to a place.
fn placed(mut mesh: TetMesh, at: DVec3) -> TetMesh {
    mesh.positions.iter_mut().for_each(|x| *x += at);
    mesh
}

/// Makes a scene, small where a quick one is asked for.
type MakeScene = fn(quick: bool) -> anyhow::Result<Scene>;

/// Cubes on each other, each shifted by a third of a cell against the one below.
fn stack(count: u32, quick: bool) -> anyhow::Result<Scene> {
    const EDGE: f64 = 0.25;
    let bodies = (0..count).map(|number| {
        let shift = if number % 2 == 1 { EDGE / 6.0 } else { 0.0 };
        let at = dvec3(shift, 0.5 * shift, EDGE * f64::from(number));
        placed(kuhn_box([2; 3], DVec3::splat(EDGE)), at)
    });
    Ok(Scene {
        name: format!("stack of {count} cubes"),
        bodies: bodies.collect(),
        planes: vec![Plane::new(DVec3::ZERO, DVec3::Z, 0.5)],
        young_modulus: 2e7,
        poisson_ratio: BodySpec::default().poisson_ratio,
        density: BodySpec::default().density,
        damping: 0.005,
        friction: 0.5,
        gravity: DVec3::NEG_Z * 9.81,
        time_step: 0.016,
        substeps: 60,
        frames: if quick { 8 } else { 90 + 20 * count },
        farthest: 5.0,
    })
}

/// Eight livers of 10 cm in two layers fall into a box.
fn pile(quick: bool) -> anyhow::Result<Scene> {
    let mut mesh = generate(Shape::Liver, if quick { 200 } else { 1_000 })?;
    mesh.positions.iter_mut().for_each(|x| *x *= 0.1);
    let places = (0..8_u32).map(|number| {
        let [x, y, z] = [number & 1, number >> 1 & 1, number >> 2].map(f64::from);
        dvec3(0.1 * (x - 0.5), 0.1 * (y - 0.5), 0.06 + 0.11 * z + 0.01 * x)
    });
    let walls = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y]
        .map(|inwards| Plane::new(-0.11 * inwards, inwards, 0.2));
    let mut planes = vec![Plane::new(DVec3::ZERO, DVec3::Z, 0.5)];
    planes.extend(walls);
    Ok(Scene {
        name: "eight organs in a box".to_owned(),
        bodies: places.map(|at| placed(mesh.clone(), at)).collect(),
        planes,
        young_modulus: 2e4,
        poisson_ratio: BodySpec::default().poisson_ratio,
        density: 1050.0,
        damping: 0.005,
        friction: ContactSpec::default().friction,
        gravity: DVec3::NEG_Z * 9.81,
        time_step: 0.016,
        substeps: SUBSTEPS,
        frames: if quick { 8 } else { 230 },
        // Half a meter, five times the size of a body.
        farthest: 0.5 / peers::mean_edge(&mesh),
    })
}

/// Frames at the end of a scene whose depth is that of rest; a quick scene has a third of its frames.
const AT_REST: u32 = 30;

/// Runs a scene and looks at its last frames.
fn depth(scene: &Scene) -> anyhow::Result<Depth> {
    let mut simulation = scene.builder().build()?;
    let mut reports = Vec::new();
    for _ in 0..scene.frames {
        reports.push(simulation.step()?.clone());
    }
    let at_rest = AT_REST.min(scene.frames / 3);
    let (before, last) = reports.split_at((scene.frames - at_rest) as usize);
    let most = |reports: &[FrameReport], of: fn(&incise::report::ContactReport) -> f64| {
        let contacts = reports.iter().filter_map(|report| report.contact);
        contacts.map(|contact| of(&contact)).fold(0.0, f64::max)
    };
    let end = simulation.report().contact.unwrap_or_default();
    Ok(Depth {
        scene: scene.name.clone(),
        tets: simulation.mesh().tets.len(),
        active: end.active,
        depths: [most(last, |c| c.max_depth), most(last, |c| c.depth_p99)],
        deepest: most(before, |c| c.max_depth),
        buried: end.buried,
        repaired: reports.iter().map(|report| report.repaired).sum(),
    })
}

/// A figure beside its aim.
fn beside(figure: f64, aim: f64, decimals: usize) -> String {
    let verdict = if figure <= aim { "reached" } else { "missed" };
    format!(
        "{:.decimals$}% (aim {}%): {verdict}",
        100.0 * figure,
        100.0 * aim
    )
}

fn page(rows: &[Row]) -> anyhow::Result<Page> {
    let mut costs = Table::new(
        format!("Cost of contact: a liver cut in two, {SUBSTEPS} substeps, f32, median frame"),
        [
            "scene",
            "threads",
            "tets",
            "candidates",
            "active",
            "colors",
            "ms without",
            "ms with",
            "of these finding, median and mean",
            "share of contact",
            "ms of the frame of the cut, without and with",
            "slowest frame",
        ],
    );
    let mut sliding = Table::new(
        "Ten slices that slide: a block of 10 cm falls while it is cut, 120 frames of 20 substeps, f32, 1 thread",
        [
            "E in Pa",
            "tets",
            "active",
            "ms of finding, mean, median and largest",
            "ms of a frame, mean",
            "largest depth of a frame, mean and largest, in mean edges",
            "99% of the contacts below, mean",
            "buried",
        ],
    );
    let mut depths = Table::new(
        "Depth at rest, in mean edges of the surface",
        [
            "scene",
            "tets",
            "active",
            "largest depth",
            "99% of the contacts below",
            "largest on the way there",
            "buried",
            "repaired",
        ],
    );
    let mut ends = Vec::new();
    for row in rows {
        match row {
            Row::End(end) => ends.push(end),
            Row::Cost(cost) => {
                let lies = cost.scene.starts_with("upper");
                costs.push([
                    cost.scene.clone(),
                    cost.threads.to_string(),
                    cost.tets.to_string(),
                    cost.candidates.to_string(),
                    cost.active.to_string(),
                    cost.colors.to_string(),
                    format!("{:.2}", cost.ms[0]),
                    format!("{:.2}", cost.ms[1]),
                    format!("{:.2}, {:.2}", cost.find_ms[0], cost.find_ms[1]),
                    beside(cost.share(), SHARES[usize::from(lies)], 1),
                    format!("{:.1}, {:.1}", cost.cut_ms[0], cost.cut_ms[1]),
                    format!("{:.1}", cost.worst_ms),
                ]);
                if lies && cost.threads == 1 {
                    depths.push([
                        "liver, upper part on the lower".to_owned(),
                        cost.tets.to_string(),
                        cost.active.to_string(),
                        beside(cost.depths[0], DEPTHS[0], 3),
                        format!("{:.3}%", 100.0 * cost.depths[1]),
                        "-".to_owned(),
                        cost.buried.to_string(),
                        "-".to_owned(),
                    ]);
                }
            }
            Row::Slices(row) => sliding.push([
                format!("{:.0e}", row.young_modulus),
                row.tets.to_string(),
                row.active.to_string(),
                row.find_ms.map(|ms| format!("{ms:.1}")).join(", "),
                format!("{:.1}", row.ms),
                format!(
                    "{:.0}%, {:.0}%",
                    100.0 * row.depths[0],
                    100.0 * row.depths[1]
                ),
                format!("{:.1}%", 100.0 * row.depths[2]),
                row.buried.to_string(),
            ]),
            Row::Depth(depth) => {
                let aim = DEPTHS[if depth.scene.starts_with("stack") {
                    1
                } else {
                    2
                }];
                depths.push([
                    depth.scene.clone(),
                    depth.tets.to_string(),
                    depth.active.to_string(),
                    beside(depth.depths[0], aim, 3),
                    format!("{:.3}%", 100.0 * depth.depths[1]),
                    format!("{:.1}%", 100.0 * depth.deepest),
                    depth.buried.to_string(),
                    depth.repaired.to_string(),
                ]);
            }
        }
    }
    let mut parts = vec![
        Part::Text(INTRODUCTION.to_owned()),
        Part::Table(costs),
        Part::Text(COSTS.to_owned()),
        Part::Table(sliding),
        Part::Table(depths),
        Part::Text(AIMS.to_owned()),
    ];
    if !ends.is_empty() {
        parts.push(Part::Table(peers::table(ends.into_iter())));
    }
    Ok(Page {
        title: "Contact".to_owned(),
        parts,
    })
}

const INTRODUCTION: &str = "What contact costs and how deep bodies get into each other, beside what is aimed at. Costs are \
of runs with contact and without in turn, frame by frame. Without contact the parts pass through each other, so the two \
do not move alike; the solver's work a tet does not depend on the motion. In the fresh cut all contacts are pairs of \
particles across it; on the ground most are vertices near triangles.";

const COSTS: &str = "The share has all that a frame takes longer: finding and coloring (once a frame), and the passes of \
the solver over the contacts (once a substep). Time by stage of the search is in `cargo bench -p incise-benches --bench contact`. A scene \
without `[contact]` is a row of [the overhead page](overhead.md).";

const AIMS: &str = "The aims: 0.1% of an edge in a stack, 1% in a body at rest on itself, 10% in a pile of organs. No \
other system that was found states depth as a part of an edge. `--python FILE` runs the stacks and the pile in two of them: \
the deepest vertex of a body inside a tet of another one, at the end, measured alike in all three. It is not the depth of a \
contact, which the table above has.";
