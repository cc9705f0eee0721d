// A pass of the first half of ECL-GC (Alabandi, Powers and Burtscher 2020): vertices with at least 32 neighbors.
//
// Neighbors see the smallest color of a palette and its largest, which never changes; shortcut 1 applies if a vertex's
// best color lies outside of this interval. A vertex whose best color changed in a pass waits for the next one.
// Smallest color and final color share a word; only its owner accesses the palette itself. A vertex that sees an old
// smallest color sees a larger interval and waits. Cost: all edges of the undecided vertices.

@group(0) @binding(2) var<storage, read> offsets: array<u32>;
@group(0) @binding(3) var<storage, read> higher: array<u32>;
@group(0) @binding(4) var<storage, read> searches: array<Search>;
@group(0) @binding(5) var<storage, read_write> palettes: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> colors: array<atomic<u32>>;

// Colors v if possible; returns true if it did.
fn decides(v: u32) -> bool {
    let begin = offsets[v];
    let end = begin + searches[v].left;
    let own = atomicLoad(&colors[v]) & ~PENDING;
    var done = true;
    var shortcut = true;
    for (var i = begin; i < end; i++) {
        let u = higher[i];
        let color = atomicLoad(&colors[u]);
        if color < PENDING {
            palette_remove(v, color);
        } else {
            done = false;
            // A palette ends where its vertex's list of higher neighbors does.
            shortcut = shortcut && (own < (color & ~PENDING) || searches[u].left < own);
        }
    }
    let best = palette_first(v, own);
    if done || (shortcut && best == own) {
        atomicStore(&colors[v], best);
        note_color(best);
        return true;
    }
    atomicStore(&colors[v], PENDING | best);
    return false;
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
