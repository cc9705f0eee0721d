// The tiles: clusters that a workgroup processes as a whole. Tets of one step share no particle and are processed side by
// side; a barrier separates the steps. Twin: Gauss-Seidel in the order color of the cluster, step, which is the order of a
// schedule without clusters colored by both.

// Capacity of a tile: 64, 128 or 256 tets, and four particles for each.
override TILE_TETS: u32 = 64u;
override TILE_PARTICLES: u32 = 4u * TILE_TETS;
// Numbers of a tile in `tiles`: its step count, its particle count, the end of each step, and the particles.
override TILE_NUMBERS: u32 = 2u + 5u * TILE_TETS;

@group(0) @binding(8) var<storage, read> tiles: array<u32>;
