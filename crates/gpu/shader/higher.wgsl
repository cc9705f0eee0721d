// Builds for each vertex the list of its neighbors of higher priority and a palette of one color more than these.
//
// The list is stored at the front of the vertex's row in a separate array, so no prefix sum is needed. It begins with
// the neighbor of lowest priority, which most likely is colored last and is therefore checked first. Cost: one walk
// over all neighbors.

@group(0) @binding(2) var<storage, read> offsets: array<u32>;
@group(0) @binding(3) var<storage, read> neighbors: array<u32>;
@group(0) @binding(4) var<storage, read_write> higher: array<u32>;
@group(0) @binding(5) var<storage, read_write> searches: array<Search>;
@group(0) @binding(6) var<storage, read_write> palettes: array<atomic<u32>>;

fn degree(v: u32) -> u32 {
    return offsets[v + 1u] - offsets[v];
}

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let v = workgroup_index(id, count) * THREADS + thread;
    if v >= current.vertices {
        return;
    }
    let begin = offsets[v];
    let end = offsets[v + 1u];
    var length = 0u;
    for (var i = begin; i < end; i++) {
        let u = neighbors[i];
        if !precedes(u, degree(u), v, end - begin) {
            continue;
        }
        var entry = u;
        if length > 0u {
            let head = higher[begin];
            if precedes(head, degree(head), u, degree(u)) {
                higher[begin] = u;
                entry = head;
            }
        }
        higher[begin + length] = entry;
        length += 1u;
    }
    searches[v] = Search(length, 0u, 0u);
    palette_fill(v, length + 1u);
}
