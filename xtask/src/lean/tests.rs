//! What repeats exactly: bytes, allocations, dispatches.

use std::sync::Arc;

use incise::gpu::{GpuContext, GpuOptions};

use super::features::cases;
use super::measure::{Memory, memory, traffic};
use super::*;

fn case(feature: &str, state: State) -> Case {
    let mut cases = cases().into_iter();
    cases
        .find(|case| (case.feature, case.state) == (feature, state))
        .unwrap()
}

fn memory_of(case: Case, tets: usize) -> Memory {
    memory(&case.scene(tets), Way::Facade).unwrap()
}

/// A frame of a scene that declares nothing asks for no memory.
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

/// What is declared but has nothing to keep, now or ever, takes no memory.
#[test]
fn what_needs_no_memory_takes_none() {
    let bare = memory_of(case(BARE, State::Base), 300);
    for (feature, state) in [
        ("gravity", State::Used),
        ("fixed particles", State::Used),
        ("damping", State::Used),
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

/// What is declared and idle takes the same memory whatever the size of the mesh, and asks for none in a frame.
#[test]
fn what_is_idle_takes_a_constant() {
    let more = |case: Case, tets| {
        let [here, bare] = [case, self::case(BARE, State::Base)].map(|case| memory_of(case, tets));
        assert_eq!(here.allocations, bare.allocations, "{}", case.id());
        here.bytes - bare.bytes
    };
    for feature in ["ground", "collider", "link", "plane stroke", "blade"] {
        let case = case(feature, State::Idle);
        let constant = more(case, 300);
        // Measured: 200 to 1344 bytes.
        assert!((1..4096).contains(&constant), "{feature}: {constant}");
        assert_eq!(more(case, 900), constant, "{feature}");
    }
}

/// Materials that differ only in their stiffness are one to the solver.
#[test]
fn a_second_stiffness_takes_no_memory() {
    let of = |feature, state| memory_of(case(feature, state), 300).bytes;
    let linked = of("two linked bodies", State::Base);
    assert_eq!(of("other stiffness", State::Used), linked);
    assert!(of("other material", State::Used) > linked);
}

/// Each substep of a bare frame is a prediction, the pass and the velocities; a frame is one pass and one submit, with
/// nothing sent and nothing read. What needs no kernel of its own adds none.
#[test]
fn a_device_is_told_only_what_a_scene_declares() {
    let Ok(gpu) = GpuContext::new(&GpuOptions::from_env()) else {
        return;
    };
    let gpu = Arc::new(gpu);
    let told = |case: Case| traffic(&case.scene(200), &gpu).unwrap().unwrap();
    let bare = told(case(BARE, State::Base));
    let frames = u64::from(measure::FRAMES);
    // 2 substeps, and a body so small is solved in one dispatch.
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
