// A pass of the second half of ECL-GC (Alabandi, Powers and Burtscher 2020): vertices with fewer than 32 neighbors.
//
// Shortcut 2 drops the edge to a neighbor that shares no color, and with it the largest color left; shortcut 1 colors a
// vertex whose best color no pending neighbor can take. A palette is one word that only its owner writes. It has one
// color more than there are pending neighbors, so one color always remains. A vertex that sees an old palette sees too
// many colors and waits. Cost: the edges to pending neighbors.

@group(0) @binding(2) var<storage, read> offsets: array<u32>;
@group(0) @binding(3) var<storage, read> higher: array<u32>;
@group(0) @binding(4) var<storage, read_write> words: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> waiting: array<u32>;
@group(0) @binding(6) var<storage, read_write> colors: array<u32>;

// Colors v if possible; returns true if it did.
fn decides(v: u32) -> bool {
    let begin = offsets[v];
    var palette = atomicLoad(&words[v]);
    var left = waiting[v];
    // The colors that the neighbors may still get.
    var around = 0u;
    for (var rest = left; rest != 0u; rest &= rest - 1u) {
        let index = countTrailingZeros(rest);
        let theirs = atomicLoad(&words[higher[begin + index]]);
        around |= theirs;
        if (palette & theirs) == 0u {
            palette &= ~(1u << (31u - countLeadingZeros(palette)));
            left &= ~(1u << index);
        } else if countOneBits(theirs) == 1u {
            palette &= ~theirs;
            left &= ~(1u << index);
        }
    }
    let color = countTrailingZeros(palette);
    if left != 0u && ((around >> color) & 1u) == 0u {
        palette = 1u << color;
        left = 0u;
    }
    atomicStore(&words[v], palette);
    waiting[v] = left;
    if countOneBits(palette) != 1u {
        return false;
    }
    colors[v] = color;
    note_color(color);
    return true;
}

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = workgroup_index(id, count) * THREADS + thread;
    var v = 0u;
    var stays = false;
    if i < listed_count() {
        v = listed(i);
        stays = !decides(v);
    }
    keep(stays, v, thread);
}
