// Between two windows of 64 colors: lists the constraints without a color again and clears the
// marks.

@group(0) @binding(2) var<storage, read> colors: array<u32>;
@group(0) @binding(3) var<storage, read_write> waits: array<Wait>;

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let v = workgroup_index(id, count) * THREADS + thread;
    var stays = false;
    if v < current.vertices && colors[v] >= PENDING {
        stays = true;
        atomicStore(&waits[v].taken[0], 0u);
        atomicStore(&waits[v].taken[1], 0u);
    }
    if v == 0u {
        work.window += 64u;
        atomicStore(&work.rest, 0u);
    }
    keep(stays, v, thread);
}
