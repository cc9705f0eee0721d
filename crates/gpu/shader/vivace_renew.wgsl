// Third part of a round of Vivace: the other vertices lose the new colors of their neighbors.
//
// A vertex with an empty palette gets the smallest color that no neighbor has. All colors below it
// are taken, so it is not larger than the degree.

@group(0) @binding(2) var<storage, read> offsets: array<u32>;
@group(0) @binding(3) var<storage, read> neighbors: array<u32>;
@group(0) @binding(4) var<storage, read> picked: array<u32>;
@group(0) @binding(5) var<storage, read> colored: array<u32>;
@group(0) @binding(6) var<storage, read_write> palettes: array<atomic<u32>>;

fn color_around(i: u32) -> u32 {
    let u = neighbors[i];
    return select(NONE, picked[u], colored[u] != 0u);
}

// Returns true if v stays on the list.
fn renew(v: u32) -> bool {
    if colored[v] != 0u {
        return false;
    }
    let round = work.rounds + 1u;
    for (var i = offsets[v]; i < offsets[v + 1u]; i++) {
        let u = neighbors[i];
        // Colors of earlier rounds have been removed before.
        if colored[u] == round {
            palette_remove(v, picked[u]);
        }
    }
    var remaining = 0u;
    for (var word = palette_begin(v); word < palette_begin(v + 1u); word++) {
        remaining |= atomicLoad(&palettes[word]);
    }
    if remaining == 0u {
        let color = first_fit(offsets[v], offsets[v + 1u]);
        atomicOr(&palettes[palette_begin(v) + (color >> 5u)], 1u << (color & 31u));
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
        stays = renew(v);
    }
    keep(stays, v, thread);
}
