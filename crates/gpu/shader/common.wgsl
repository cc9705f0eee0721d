// Constants and functions shared by all kernels.

// Threads of a workgroup.
const THREADS: u32 = 64u;

// The number of a workgroup in a grid of one or more rows.
fn workgroup_index(id: vec3<u32>, count: vec3<u32>) -> u32 {
    return id.y * count.x + id.x;
}
