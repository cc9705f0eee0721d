// Damps one group of clusters, which share no particle: a thread for each cluster, tet by tet. Twin: `damp_block` in
// `simd_kernel.rs` of incise-xpbd.

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
        let v = Corners(
            weighted_velocity(corner.x),
            weighted_velocity(corner.y),
            weighted_velocity(corner.z),
            weighted_velocity(corner.w),
        );
        // On its way while this tet is damped, as in `group.wgsl`.
        slot = min(slot + THREADS, last);
        let next_corner = corners[slot];
        let next_tet = tet_at(slot);
        let damped = damp_tet(tet, x, v);
        velocities[corner.x] = vec4(damped.x0.xyz, 0.0);
        velocities[corner.y] = vec4(damped.x1.xyz, 0.0);
        velocities[corner.z] = vec4(damped.x2.xyz, 0.0);
        velocities[corner.w] = vec4(damped.x3.xyz, 0.0);
        corner = next_corner;
        tet = next_tet;
    }
}
