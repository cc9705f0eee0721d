// Solves one tile with its particles in workgroup memory.

var<workgroup> shared_particles: array<vec4<f32>, TILE_PARTICLES>;

fn solve_tile(tile: u32, lane: u32) {
    let header = tile * TILE_NUMBERS;
    let steps = tiles[header];
    let count = tiles[header + 1u];
    let ends = header + 2u;
    let list = ends + TILE_TETS;
    for (var i = lane; i < count; i += THREADS) {
        shared_particles[i] = particles[tiles[list + i]];
    }
    workgroupBarrier();
    var start = 0u;
    for (var k = 0u; k < steps; k++) {
        let end = tiles[ends + k];
        for (var i = start + lane; i < end; i += THREADS) {
            let slot = tile * TILE_TETS + i;
            let corner = corners[slot];
            let x = Corners(
                shared_particles[corner.x],
                shared_particles[corner.y],
                shared_particles[corner.z],
                shared_particles[corner.w],
            );
            var multiplier = vec2(0.0);
            if KEEPS {
                multiplier = multipliers[slot];
            }
            let moved = solve_tet(tet_at(slot), x, false, &multiplier);
            if KEEPS {
                multipliers[slot] = multiplier;
            }
            shared_particles[corner.x] = moved.x0;
            shared_particles[corner.y] = moved.x1;
            shared_particles[corner.z] = moved.x2;
            shared_particles[corner.w] = moved.x3;
        }
        start = end;
        workgroupBarrier();
    }
    for (var i = lane; i < count; i += THREADS) {
        particles[tiles[list + i]] = shared_particles[i];
    }
}
