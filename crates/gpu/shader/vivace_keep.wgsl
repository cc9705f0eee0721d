// Second part of a round of Vivace: marks the vertices that keep their pick.
//
// A vertex keeps its pick if it has the highest number among the uncolored neighbors with an equal pick; by the weaker
// rule, if it has the highest number among all its uncolored neighbors. Marks of this round are written while others
// read, so a vertex marked with this round counts as uncolored.

@group(0) @binding(2) var<uniform> settings: VivaceSettings;
@group(0) @binding(3) var<storage, read> offsets: array<u32>;
@group(0) @binding(4) var<storage, read> neighbors: array<u32>;
@group(0) @binding(5) var<storage, read> picked: array<u32>;
@group(0) @binding(6) var<storage, read_write> colored: array<atomic<u32>>;

fn keeps(v: u32, round: u32) -> bool {
    let own = picked[v];
    if own == NONE {
        return false;
    }
    var same = false;
    var higher = false;
    for (var i = offsets[v]; i < offsets[v + 1u]; i++) {
        let u = neighbors[i];
        let mark = atomicLoad(&colored[u]);
        if mark == 0u || mark == round {
            let equal = picked[u] == own;
            if settings.highest_of_all == 0u && equal && u > v {
                return false;
            }
            same = same || equal;
            higher = higher || u > v;
        }
    }
    return settings.highest_of_all == 0u || !same || !higher;
}

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = workgroup_index(id, count) * THREADS + thread;
    if i < listed_count() {
        let v = listed(i);
        let round = work.rounds + 1u;
        if keeps(v, round) {
            atomicStore(&colored[v], round);
        }
    }
}
