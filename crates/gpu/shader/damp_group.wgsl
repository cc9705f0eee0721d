// Damps one group of clusters, which share no particle: a thread for each cluster, tet by tet. Twin: `damp_block` in
// `simd_kernel.rs` of incise-xpbd.

fn solve_group(group: u32, lane: u32) {
    for (var k = 0u; k < settings.depth; k++) {
        let slot = (group * settings.depth + k) * THREADS + lane;
        let corner = corners[slot];
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
        let damped = damp_tet(tet_at(slot), x, v);
        velocities[corner.x] = vec4(damped.x0.xyz, 0.0);
        velocities[corner.y] = vec4(damped.x1.xyz, 0.0);
        velocities[corner.z] = vec4(damped.x2.xyz, 0.0);
        velocities[corner.w] = vec4(damped.x3.xyz, 0.0);
    }
}
