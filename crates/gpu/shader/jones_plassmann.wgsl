// A round of Jones and Plassmann (1993), largest degree first: a vertex without pending neighbors takes the smallest
// free color.
//
// Colors are final, and a vertex stores how many entries of its row are already colored, so each neighbor is awaited
// once over all rounds. Colors are atomics because other vertices are decided at the same time. A vertex sees them in
// this round or in the next, which changes the number of rounds but not the colors. Cost: each edge twice.

@group(0) @binding(2) var<storage, read> offsets: array<u32>;
@group(0) @binding(3) var<storage, read> neighbors: array<u32>;
@group(0) @binding(4) var<storage, read_write> colors: array<atomic<u32>>;
// The number of leading neighbors of a row that no longer block its vertex.
@group(0) @binding(5) var<storage, read_write> passed: array<u32>;

fn color_around(i: u32) -> u32 {
    return atomicLoad(&colors[neighbors[i]]);
}

// Colors v if possible; returns true if it did.
fn decides(v: u32) -> bool {
    let begin = offsets[v];
    let end = offsets[v + 1u];
    for (var i = begin + passed[v]; i < end; i++) {
        let u = neighbors[i];
        let first = precedes(u, offsets[u + 1u] - offsets[u], v, end - begin);
        if first && color_around(i) >= PENDING {
            passed[v] = i - begin;
            return false;
        }
    }
    let color = first_fit(begin, end);
    atomicStore(&colors[v], color);
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
