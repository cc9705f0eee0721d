// First part of a step of WLC (Chen, Li and Yang 2017): a chunk of the worklist takes the smallest colors left.
//
// All choose from the state before the step, so neighbors may choose equal colors.

@group(0) @binding(1) var<storage, read> work: WlcWork;
@group(0) @binding(2) var<storage, read> offsets: array<u32>;
@group(0) @binding(3) var<storage, read> neighbors: array<u32>;
@group(0) @binding(4) var<storage, read_write> picked: array<u32>;
@group(0) @binding(5) var<storage, read> colors: array<u32>;

fn color_around(i: u32) -> u32 {
    return colors[neighbors[i]];
}

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = workgroup_index(id, count) * THREADS + thread;
    if i < min(work.chunk, work.count - work.done) {
        let v = work.list[work.begin + work.done + i];
        picked[v] = first_fit(offsets[v], offsets[v + 1u]);
    }
}
