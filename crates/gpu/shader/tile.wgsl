// One tile: a cluster that a workgroup solves as a whole, its particles in workgroup memory. Tets of one step share no
// particle and are solved side by side; a barrier parts the steps. Twin: Gauss-Seidel in the order color of the cluster,
// step, which is that of a schedule without clusters colored by both.

// Most tets of a tile: 64, 128 or 256, and the particles of as many that share none.
override TILE_TETS: u32 = 64u;
override TILE_PARTICLES: u32 = 4u * TILE_TETS;
// What a tile has in `tiles`: the number of its steps, that of its particles, where each step ends, and the particles.
override TILE_NUMBERS: u32 = 2u + 5u * TILE_TETS;

@group(0) @binding(9) var<storage, read> tiles: array<u32>;

var<workgroup> shared_particles: array<vec4<f32>, TILE_PARTICLES>;

fn previous_of(list: u32, corner: vec4<u32>) -> Corners {
    return Corners(
        previous[tiles[list + corner.x]],
        previous[tiles[list + corner.y]],
        previous[tiles[list + corner.z]],
        previous[tiles[list + corner.w]],
    );
}

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
            let place = tile * TILE_TETS + i;
            let corner = corners[place];
            let x = Corners(
                shared_particles[corner.x],
                shared_particles[corner.y],
                shared_particles[corner.z],
                shared_particles[corner.w],
            );
            var before = x;
            if DAMPED {
                before = previous_of(list, corner);
            }
            var multiplier = vec2(0.0);
            if KEEPS {
                multiplier = multipliers[place];
            }
            let moved = solve_tet(tet_at(place), x, before, false, &multiplier);
            if KEEPS {
                multipliers[place] = multiplier;
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
