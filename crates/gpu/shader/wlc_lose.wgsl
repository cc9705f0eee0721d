// Second part of a step of WLC: of two neighbors with equal choices, the one with the lower number loses.
//
// Vertices outside of the chunk have picked nothing, and no vertex chose the color of a colored neighbor.

@group(0) @binding(1) var<storage, read> work: WlcWork;
@group(0) @binding(2) var<storage, read> offsets: array<u32>;
@group(0) @binding(3) var<storage, read> neighbors: array<u32>;
@group(0) @binding(4) var<storage, read> picked: array<u32>;
// For each entry of the chunk, true if it lost.
@group(0) @binding(5) var<storage, read_write> lost: array<u32>;

fn loses(v: u32) -> u32 {
    // Rows ascend, so the higher neighbors are the last ones.
    for (var i = offsets[v + 1u]; i > offsets[v]; i--) {
        let u = neighbors[i - 1u];
        if u < v {
            break;
        }
        if picked[u] == picked[v] {
            return 1u;
        }
    }
    return 0u;
}

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = workgroup_index(id, count) * THREADS + thread;
    if i < min(work.chunk, work.count - work.done) {
        lost[i] = loses(work.list[work.begin + work.done + i]);
    }
}
