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
        assert_eq!(memory(&bare.scene(300), way).unwrap().allocations, 0, "{way:?}");
    }
}
