// Marks the colors in use.

@group(0) @binding(2) var<storage, read> colors: array<u32>;

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let v = workgroup_index(id, count) * THREADS + thread;
    if v < current.vertices {
        let color = colors[v];
        atomicStore(&all.names[color], 1u);
        if atomicLoad(&all.count) <= color {
            atomicMax(&all.count, color + 1u);
        }
    }
}
