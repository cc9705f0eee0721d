//! Tests of exactly reproducible values: bytes, allocations, dispatches.

use std::sync::Arc;

use incise::gpu::{GpuContext, GpuOptions};

use super::callgrind::Counts;
use super::features::{BARE, cases};
use super::measure::{Memory, memory, traffic};
use super::*;
use crate::experiment::Part;

fn case(feature: &str, state: State) -> Case {
    let mut cases = cases().into_iter();
    cases
        .find(|case| (case.feature, case.state) == (feature, state))
        .unwrap()
}

fn memory_of(case: Case, tets: usize) -> Memory {
    memory(&case.scene(tets), Way::Facade).unwrap()
}

/// A frame of a scene without features allocates no memory.
#[test]
fn a_bare_frame_asks_for_no_memory() {
    let bare = case(BARE, State::Base);
    for way in [Way::Facade, Way::Hand] {
        assert_eq!(
            memory(&bare.scene(300), way).unwrap().allocations,
            0,
            "{way:?}"
        );
    }
}

/// Declared features that never need storage take no memory.
#[test]
fn features_without_memory_take_none() {
    let bare = memory_of(case(BARE, State::Base), 300);
    for (feature, state) in [
        ("gravity", State::Used),
        ("fixed particles", State::Used),
        ("relaxation", State::Used),
        ("sequential form", State::Used),
        ("kappa limit", State::Used),
        ("no merging", State::Used),
    ] {
        assert_eq!(memory_of(case(feature, state), 300), bare, "{feature}");
    }
    let stroke = memory_of(case("plane stroke", State::Idle), 300);
    assert_eq!(memory_of(case("snapping", State::Idle), 300), stroke);
}

/// Declared idle features take memory independent of the mesh size, and allocate none in a frame.
#[test]
fn idle_features_take_a_constant() {
    let more = |case: Case, tets| {
        let [here, bare] = [case, self::case(BARE, State::Base)].map(|case| memory_of(case, tets));
        assert_eq!(here.allocations, bare.allocations, "{}", case.id());
        here.bytes - bare.bytes
    };
    for feature in ["ground", "collider", "distance", "plane stroke", "blade"] {
        let case = case(feature, State::Idle);
        let constant = more(case, 300);
        // Measured: 200 to 1344 bytes.
        assert!((1..4096).contains(&constant), "{feature}: {constant}");
        assert_eq!(more(case, 900), constant, "{feature}");
    }
}

/// Materials that differ only in their stiffness take no more memory than one.
#[test]
fn a_second_stiffness_takes_no_memory() {
    let of = |feature, state| memory_of(case(feature, state), 300).bytes;
    let linked = of("two linked bodies", State::Base);
    assert_eq!(of("other stiffness", State::Used), linked);
    assert!(of("other material", State::Used) > linked);
}

/// Each substep of a bare frame is a prediction, the constraint pass and the velocities; a frame is one pass and one
/// submit, without uploads or readbacks. Features without a kernel add no dispatch.
#[test]
fn only_declared_features_are_sent_to_a_device() {
    let Ok(gpu) = GpuContext::new(&GpuOptions::from_env()) else {
        return;
    };
    let gpu = Arc::new(gpu);
    let told = |case: Case| traffic(&case.scene(200), &gpu).unwrap().unwrap();
    let bare = told(case(BARE, State::Base));
    let frames = u64::from(measure::FRAMES);
    // 2 substeps; a body this small is solved in one dispatch.
    assert_eq!(bare.dispatches, 2 * 3 * frames);
    assert_eq!((bare.passes, bare.submits), (frames, frames));
    assert_eq!((bare.uploaded, bare.readbacks, bare.read), (0, 0, 0));
    for (feature, state) in [
        ("gravity", State::Used),
        ("fixed particles", State::Used),
        ("plane stroke", State::Idle),
        ("kappa limit", State::Idle),
    ] {
        assert_eq!(told(case(feature, state)), bare, "{feature}");
    }
    assert_eq!(told(case("ground", State::Idle)).dispatches, 2 * 4 * frames);
}

/// Functions that run in every scene.
const EVERYWHERE: [&str; 3] = [
    "incise_xpbd::floating_origin::recenter",
    "incise_xpbd::degeneracy_jitter::jitter",
    "<Solver as ErasedSolver>::max_speed",
];

/// A scene of one or two thousand particles whose frames take `each` instructions per particle and `once` more.
fn row(feature: &str, state: State, each: u64, once: u64) -> Row {
    let size = |particles: usize| Measured {
        tets: 4 * particles,
        particles,
        memory: Memory {
            bytes: 100,
            ready_to_cut: 10,
            allocations: 0,
        },
        counts: Some(Counts {
            instructions: u64::from(measure::FRAMES) * (each * particles as u64 + once),
            functions: EVERYWHERE.map(|name| (name.to_owned(), 1)).into(),
            ..Counts::default()
        }),
        device: None,
    };
    Row {
        feature: feature.to_owned(),
        state: state.name().to_owned(),
        base: BARE.to_owned(),
        what: String::new(),
        valgrind: Some("valgrind-0".to_owned()),
        sizes: vec![size(1000), size(2000)],
    }
}

/// Constants are distinguished from costs per element; without valgrind cells are empty.
#[test]
fn the_page_distinguishes_constants_from_passes() {
    let mut rows = vec![
        row("hand", State::Base, 50, 0),
        row("empty", State::Base, 0, 7),
        row(BARE, State::Base, 50, 30),
        row("sleep", State::Idle, 50, 42),
        row("gravity", State::Used, 58, 30),
    ];
    let cells = |rows: &[Row], name: &str| {
        let parts = page::page(rows).unwrap().parts;
        let tables = parts.into_iter().filter_map(|part| match part {
            Part::Table(table) => Some(table.rows),
            _ => None,
        });
        let mut lines = tables.flatten();
        lines
            .find(|line| line.iter().any(|cell| cell == name))
            .unwrap()
    };
    assert_eq!(cells(&rows, "scene, beyond the hand-written loop")[3], "30");
    let idle = page::declared_table("", &rows, State::Idle).unwrap();
    assert_eq!(idle.rows[0][2..6], ["12", "0.012", "0", "0.00"]);
    let used = page::declared_table("", &rows, State::Used).unwrap();
    assert_eq!(used.rows[0][2..6], ["16000", "15.995", "0", "8.00"]);
    // A feature in use of which no function runs has functions of other names.
    let mut renamed = rows.clone();
    renamed.push(row("jacobi", State::Used, 50, 30));
    let error = page::page(&renamed).unwrap_err().to_string();
    assert!(error.contains("Jacobi"), "{error}");
    for row in &mut rows {
        row.valgrind = None;
        row.sizes.iter_mut().for_each(|size| size.counts = None);
    }
    assert_eq!(cells(&rows, "scene, beyond the hand-written loop")[3], "-");
}
