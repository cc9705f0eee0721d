// Replaces the color of each vertex by its new number.

@group(0) @binding(2) var<storage, read_write> colors: array<u32>;

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let v = workgroup_index(id, count) * THREADS + thread;
    if v < current.vertices {
        colors[v] = atomicLoad(&all.names[colors[v]]);
    }
}
