// Initialization of the first half of ECL-GC: no vertex has a color, and vertices with at least 32
// neighbors are on the list.

const LARGE: u32 = 32u;

@group(0) @binding(2) var<storage, read> offsets: array<u32>;
@group(0) @binding(3) var<storage, read_write> colors: array<u32>;

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let v = workgroup_index(id, count) * THREADS + thread;
    var large = false;
    if v < current.vertices {
        colors[v] = PENDING;
        large = offsets[v + 1u] - offsets[v] >= LARGE;
    }
    keep(large, v, thread);
}
