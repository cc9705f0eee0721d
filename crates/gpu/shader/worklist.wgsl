// The vertices without a color: two lists, of which a round reads one and fills the other.
//
// The order of a list does not matter. A workgroup reserves space once instead of once per vertex: one atomic addition
// instead of 64.

// The mark of an uncolored vertex; the bits below it are the smallest color that it may still get.
const PENDING: u32 = 0x80000000u;

struct Work {
    counts: array<atomic<u32>, 2>,
    // Rounds with a non-empty list.
    rounds: u32,
    // The largest color plus one.
    colors: atomic<u32>,
    // Vertices without a color in the window.
    rest: atomic<u32>,
    // The first color of the window.
    window: u32,
    list: array<u32>,
}

@group(0) @binding(1) var<storage, read_write> work: Work;

var<workgroup> kept: atomic<u32>;
var<workgroup> room: u32;

// The length of this round's list.
fn listed_count() -> u32 {
    return atomicLoad(&work.counts[current.parity]);
}

// An entry of this round's list.
fn listed(i: u32) -> u32 {
    return work.list[current.parity * current.vertices + i];
}

// Puts a vertex on the next round's list if it stays. All threads of a workgroup have to call this exactly once.
fn keep(stays: bool, v: u32, thread: u32) {
    var position = 0u;
    if stays {
        position = atomicAdd(&kept, 1u);
    }
    workgroupBarrier();
    let next = 1u - current.parity;
    if thread == 0u {
        room = atomicAdd(&work.counts[next], atomicLoad(&kept));
    }
    workgroupBarrier();
    if stays {
        work.list[next * current.vertices + room + position] = v;
    }
}

// Records that a color is in use.
fn note_color(color: u32) {
    if atomicLoad(&work.colors) <= color {
        atomicMax(&work.colors, color + 1u);
    }
}
