// Damps one tile with the velocities and inverse masses of its particles in workgroup memory. Positions are read from the
// buffer: they do not change, and workgroup memory has no room for them.

var<workgroup> shared_velocities: array<vec4<f32>, TILE_PARTICLES>;

fn solve_tile(tile: u32, lane: u32) {
    let header = tile * TILE_NUMBERS;
    let steps = tiles[header];
    let count = tiles[header + 1u];
    let ends = header + 2u;
    let list = ends + TILE_TETS;
    for (var i = lane; i < count; i += THREADS) {
        shared_velocities[i] = weighted_velocity(tiles[list + i]);
    }
    workgroupBarrier();
    var start = 0u;
    for (var k = 0u; k < steps; k++) {
        let end = tiles[ends + k];
        for (var i = start + lane; i < end; i += THREADS) {
            let slot = tile * TILE_TETS + i;
            let corner = corners[slot];
            let x = Corners(
                particles[tiles[list + corner.x]],
                particles[tiles[list + corner.y]],
                particles[tiles[list + corner.z]],
                particles[tiles[list + corner.w]],
            );
            let v = Corners(
                shared_velocities[corner.x],
                shared_velocities[corner.y],
                shared_velocities[corner.z],
                shared_velocities[corner.w],
            );
            let damped = damp_tet(tet_at(slot), x, v);
            shared_velocities[corner.x] = damped.x0;
            shared_velocities[corner.y] = damped.x1;
            shared_velocities[corner.z] = damped.x2;
            shared_velocities[corner.w] = damped.x3;
        }
        start = end;
        workgroupBarrier();
    }
    for (var i = lane; i < count; i += THREADS) {
        velocities[tiles[list + i]] = vec4(shared_velocities[i].xyz, 0.0);
    }
}
