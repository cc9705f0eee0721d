// Before the first round of Vivace: palettes of degree / s + 1 colors, and all vertices are on the list.

@group(0) @binding(2) var<uniform> settings: VivaceSettings;
@group(0) @binding(3) var<storage, read> offsets: array<u32>;
@group(0) @binding(4) var<storage, read_write> palettes: array<atomic<u32>>;
// The round that colored a vertex, counted from 1.
@group(0) @binding(5) var<storage, read_write> colored: array<u32>;

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let v = workgroup_index(id, count) * THREADS + thread;
    let exists = v < current.vertices;
    if exists {
        palette_fill(v, (offsets[v + 1u] - offsets[v]) / settings.shrinking + 1u);
        colored[v] = 0u;
    }
    keep(exists, v, thread);
}
