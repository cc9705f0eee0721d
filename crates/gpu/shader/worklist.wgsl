// The vertices without a color: two lists, of which a round reads one and fills the other.
//
// A list has no order that matters. A workgroup asks for room once and not once a vertex: one addition that all
// workgroups wait for instead of 64.

// The mark of a vertex without a color; below it is the smallest color that it may still get.
const PENDING: u32 = 0x80000000u;

struct Work {
    counts: array<atomic<u32>, 2>,
    // Rounds that had something to do.
    rounds: u32,
    // The largest color plus one.
    colors: atomic<u32>,
    // Vertices that found no color in the window.
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

// An entry of it.
fn listed(i: u32) -> u32 {
    return work.list[current.parity * current.vertices + i];
}

// Puts a vertex on the next round's list, if it is to stay. All threads of a workgroup have to come here, once.
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

// Notes that a color is in use.
fn note_color(color: u32) {
    if atomicLoad(&work.colors) <= color {
        atomicMax(&work.colors, color + 1u);
    }
}
