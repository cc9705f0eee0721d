// Solves one group of clusters, which share no particle: a thread for each cluster, tet by tet (paper section 4.1). Twin:
// `solve_block` in `simd_kernel.rs` of incise-xpbd.

// True if corrections are summed in a buffer and particles stay unchanged.
override JACOBI: bool = false;

@group(0) @binding(8) var<storage, read_write> corrections: array<vec4<f32>>;

fn solve_group(group: u32, lane: u32) {
    var slot = group * settings.depth * THREADS + lane;
    let last = slot + (settings.depth - 1u) * THREADS;
    var corner = corners[slot];
    var tet = tet_at(slot);
    for (var k = 0u; k < settings.depth; k++) {
        if corner.x == corner.y {
            // The tets of a cluster are in its first slots.
            return;
        }
        let x = Corners(particles[corner.x], particles[corner.y], particles[corner.z], particles[corner.w]);
        // What the next tet needs is on its way while this one is solved: a device waits for each load in turn otherwise.
        let next = min(slot + THREADS, last);
        let next_corner = corners[next];
        let next_tet = tet_at(next);
        var multiplier = vec2(0.0);
        if KEEPS {
            multiplier = multipliers[slot];
        }
        let moved = solve_tet(tet, x, JACOBI, &multiplier);
        if KEEPS {
            multipliers[slot] = multiplier;
        }
        if JACOBI {
            corrections[corner.x] += vec4(moved.x0.xyz - x.x0.xyz, 0.0);
            corrections[corner.y] += vec4(moved.x1.xyz - x.x1.xyz, 0.0);
            corrections[corner.z] += vec4(moved.x2.xyz - x.x2.xyz, 0.0);
            corrections[corner.w] += vec4(moved.x3.xyz - x.x3.xyz, 0.0);
        } else {
            particles[corner.x] = moved.x0;
            particles[corner.y] = moved.x1;
            particles[corner.z] = moved.x2;
            particles[corner.w] = moved.x3;
        }
        slot = next;
        corner = next_corner;
        tet = next_tet;
    }
}
