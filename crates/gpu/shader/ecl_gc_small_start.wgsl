// Between the halves of ECL-GC: vertices with fewer than 32 neighbors go on the list, with a palette of one word each.
//
// The palette of a colored vertex is its color. Small vertices never reach colors from 32 on, so the palettes of large
// vertices with such a color are empty.

const LARGE: u32 = 32u;

@group(0) @binding(2) var<storage, read> offsets: array<u32>;
@group(0) @binding(3) var<storage, read> searches: array<Search>;
@group(0) @binding(4) var<storage, read> colors: array<u32>;
@group(0) @binding(5) var<storage, read_write> words: array<u32>;
// The higher neighbors on which a small vertex waits, a bit for each index in its list.
@group(0) @binding(6) var<storage, read_write> waiting: array<u32>;

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let v = workgroup_index(id, count) * THREADS + thread;
    var small = false;
    if v < current.vertices {
        small = offsets[v + 1u] - offsets[v] < LARGE;
        if small {
            let left = searches[v].left;
            words[v] = 0xffffffffu >> (31u - left);
            waiting[v] = (1u << left) - 1u;
        } else {
            words[v] = select(0u, 1u << (colors[v] & 31u), colors[v] < 32u);
        }
    }
    keep(small, v, thread);
}
