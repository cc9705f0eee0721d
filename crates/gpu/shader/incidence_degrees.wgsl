// Counts the constraints that conflict with each constraint.
//
// A constraint that shares several particles is counted at the first of them. Cost: the constraints
// around each particle, times the particles before it, times the logarithm of their valence.

@group(0) @binding(4) var<storage, read_write> degrees: array<u32>;

// True if u is among the constraints of p, which are in ascending order.
fn is_on(u: u32, p: u32) -> bool {
    var low = constraints_of[p];
    var high = constraints_of[p + 1u];
    while low < high {
        let middle = low + (high - low) / 2u;
        if constraints_of[middle] < u {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low < constraints_of[p + 1u] && constraints_of[low] == u;
}

fn degree(v: u32) -> u32 {
    let begin = particles_of[v];
    var count = 0u;
    for (var i = begin; i < particles_of[v + 1u]; i++) {
        let p = particles_of[i];
        for (var k = constraints_of[p]; k < constraints_of[p + 1u]; k++) {
            let u = constraints_of[k];
            var is_new = u != v;
            for (var j = begin; is_new && j < i; j++) {
                is_new = !is_on(u, particles_of[j]);
            }
            count += u32(is_new);
        }
    }
    return count;
}

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let v = workgroup_index(id, count) * THREADS + thread;
    if v < current.vertices {
        degrees[v] = degree(v);
    }
}
