// A round of shortcut graph coloring (paper section 4.1, Algorithm 1) with all three shortcuts.
//
// v takes the smallest color of its palette if every neighbor u of higher priority has another color, or has a larger
// smallest color (shortcut 3), or does not have that color in its palette (shortcut 1). If the palettes are disjoint
// the edge is dropped, and with it the largest color of v (shortcut 2).
//
// Other vertices are decided in the same dispatch, in no guaranteed order. That is sound, since each test needs one
// word of u only and stays true under all later writes: a color is final, palettes shrink, smallest colors grow. A
// decided vertex keeps its color in its palette, so a vertex that still sees it as undecided does not take its color. v
// removes the colors of decided neighbors from its palette itself before it counts the pending ones, because their own
// removals may not be visible yet. Hence the colors are those of the sequential algorithm and only the number of rounds
// depends on the device.
//
// Cost: each edge twice for the removals, and once for each smallest color that its lower vertex passes over.

@group(0) @binding(2) var<storage, read> offsets: array<u32>;
@group(0) @binding(3) var<storage, read> neighbors: array<u32>;
@group(0) @binding(4) var<storage, read_write> higher: array<u32>;
@group(0) @binding(5) var<storage, read_write> searches: array<Search>;
@group(0) @binding(6) var<storage, read_write> palettes: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> colors: array<atomic<u32>>;

// True if u and v have no color in common.
fn disjoint(u: u32, v: u32) -> bool {
    let a = palette_begin(u);
    let b = palette_begin(v);
    let words = min(palette_begin(u + 1u) - a, palette_begin(v + 1u) - b);
    for (var word = 0u; word < words; word++) {
        if (atomicLoad(&palettes[a + word]) & atomicLoad(&palettes[b + word])) != 0u {
            return false;
        }
    }
    return true;
}

// Reduces the palette of v to its smallest colors.
fn keep_smallest(v: u32, size: u32) {
    var left = size;
    for (var word = palette_begin(v); word < palette_begin(v + 1u); word++) {
        let bits = atomicLoad(&palettes[word]);
        let count = countOneBits(bits);
        var dropped = 0u;
        for (var i = left; i < count; i++) {
            dropped |= 1u << (31u - countLeadingZeros(bits & ~dropped));
        }
        if dropped != 0u {
            // An atomic operation, because other threads may remove colors at the same time.
            atomicAnd(&palettes[word], ~dropped);
        }
        left -= min(left, count);
    }
}

fn exchange(a: u32, b: u32) {
    let entry = higher[a];
    higher[a] = higher[b];
    higher[b] = entry;
}

// Colors v if possible; returns true if it did.
fn decides(v: u32) -> bool {
    let begin = offsets[v];
    var search = searches[v];
    var best = palette_first(v, atomicLoad(&colors[v]) & ~PENDING);
    if search.passed_for != best {
        // The neighbor that blocked v most likely still does, so it is checked first.
        if search.passed < search.left {
            exchange(begin, begin + search.passed);
        }
        search.passed = 0u;
        search.passed_for = best;
    }
    var stopped = false;
    var dropped = false;
    while search.passed < search.left {
        let u = higher[begin + search.passed];
        let color = atomicLoad(&colors[u]);
        if color < PENDING {
            // A decided neighbor is no longer pending.
            palette_remove(v, color);
            search.left -= 1u;
            exchange(begin + search.passed, begin + search.left);
            if color == best {
                best = palette_first(v, best);
                search.passed = 0u;
                search.passed_for = best;
            }
        } else if best < (color & ~PENDING) || !palette_contains(u, best) {
            if disjoint(u, v) {
                search.left -= 1u;
                exchange(begin + search.passed, begin + search.left);
                dropped = true;
            } else {
                search.passed += 1u;
            }
        } else {
            stopped = true;
            break;
        }
    }
    if stopped {
        if dropped {
            // Each pending neighbor can remove one color, so one more than their number is enough.
            keep_smallest(v, search.left + 1u);
        }
        searches[v] = search;
        atomicStore(&colors[v], PENDING | best);
        return false;
    }
    atomicStore(&colors[v], best);
    note_color(best);
    // Neighbors of higher priority cannot get this color, so it is not removed from theirs.
    for (var i = begin; i < offsets[v + 1u]; i++) {
        palette_remove(neighbors[i], best);
    }
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
