// Elastic energy, change of volume, least ratio and inverted tets, summed up by workgroups. Twin: `Solver::energy` and
// `Solver::volume` of incise-xpbd.
//
// At rest both terms of the energy are large and cancel. It is therefore written in the strain A = F^T F - 1, which is
// small for a rotated tet: with d = det F - 1 and m the second and third invariant of A,
// d (d + 2) = tr A + m and |F|^2 - 3 = tr A, and the energy in units of half the stiffness is
// d^2 - m + ratio d^2 + 2 slope d, where slope = 1 + ratio (1 - gamma) is 0 up to rounding.

override UNIFORM: bool = true;
// True if corners are numbered within tiles.
override TILED: bool = false;

const NUMBERS: u32 = 16u;
// Sizes of a tile, equal to those in `tiles.wgsl`.
override TILE_TETS: u32 = 64u;
override TILE_NUMBERS: u32 = 2u + 5u * TILE_TETS;

struct Units {
    // Slots for tets.
    tet_slots: u32,
    // The cube root of a tet's mean volume at rest in m.
    length: f32,
    // Material constants if there is a single material.
    slope: f32,
    unused: u32,
}

struct TetSums {
    // In J.
    energy: f32,
    // In units of the mean volume at rest.
    change: f32,
    least: f32,
    inverted: u32,
}

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<uniform> units: Units;
@group(0) @binding(2) var<storage, read> particles: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> rest: array<f32>;
@group(0) @binding(5) var<storage, read> constants: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> tiles: array<u32>;
@group(0) @binding(7) var<storage, read_write> tet_sums: array<TetSums>;

var<workgroup> lanes: array<TetSums, THREADS>;

fn add(a: TetSums, b: TetSums) -> TetSums {
    return TetSums(a.energy + b.energy, a.change + b.change, min(a.least, b.least), a.inverted + b.inverted);
}

fn gradient(at: u32, corner: u32) -> vec3<f32> {
    let first = at + 3u * corner * THREADS;
    return vec3(rest[first], rest[first + THREADS], rest[first + 2u * THREADS]);
}

fn measure(slot: u32, corner: vec4<u32>) -> TetSums {
    let at = (slot / THREADS) * (NUMBERS * THREADS) + slot % THREADS;
    let q1 = gradient(at, 0u);
    let q2 = gradient(at, 1u);
    let q3 = gradient(at, 2u);
    let stiffness = rest[at + 15u * THREADS];
    var ratio = settings.material.x;
    var slope = units.slope;
    if !UNIFORM {
        ratio = constants[slot].x;
        slope = constants[slot].w;
    }
    let origin = particles[corner.x].xyz;
    let e1 = particles[corner.y].xyz - origin;
    let e2 = particles[corner.z].xyz - origin;
    let e3 = particles[corner.w].xyz - origin;
    let a = e1 * q1.x + e2 * q2.x + e3 * q3.x;
    let b = e1 * q1.y + e2 * q2.y + e3 * q3.y;
    let c = e1 * q1.z + e2 * q2.z + e3 * q3.z;
    let det = dot(a, cross(b, c));
    let same = vec3(dot(a, a) - settings.one, dot(b, b) - settings.one, dot(c, c) - settings.one);
    let mixed = vec3(dot(b, c), dot(a, c), dot(a, b));
    let trace = same.x + same.y + same.z;
    var d = det - settings.one;
    var first = trace - (d + d);
    // Far from rest nothing cancels, and the invariants are less precise than the determinant.
    if det > 0.0 && dot(same, same) + dot(mixed, mixed) < settings.one {
        let second = same.x * same.y + same.y * same.z + same.z * same.x - dot(mixed, mixed);
        let third = same.x * same.y * same.z + (mixed.x * mixed.y * mixed.z) * 2.0
            - dot(same, mixed * mixed);
        d = (trace + second + third) / (det + settings.one);
        first = d * d - (second + third);
    }
    let energy = 0.5 * stiffness * (first + ratio * d * d + 2.0 * slope * d);
    // One over six volumes at rest; 0 for a tet that is too flat to be solved. Its sign is that of the order of corners.
    let per_volumes = abs(dot(q1 * units.length, cross(q2 * units.length, q3 * units.length)));
    var change = 0.0;
    if per_volumes > 0.0 {
        change = d / (6.0 * per_volumes);
    }
    return TetSums(energy, change, det, u32(det <= 0.0));
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
) {
    var sums = TetSums(0.0, 0.0, settings.one, 0u);
    for (var slot = id.x * THREADS + lane; slot < units.tet_slots; slot += count.x * THREADS) {
        var corner = corners[slot];
        if corner.x == corner.y {
            // The slot is empty.
            continue;
        }
        if TILED {
            let list = slot / TILE_TETS * TILE_NUMBERS + 2u + TILE_TETS;
            corner = vec4(
                tiles[list + corner.x],
                tiles[list + corner.y],
                tiles[list + corner.z],
                tiles[list + corner.w],
            );
        }
        sums = add(sums, measure(slot, corner));
    }
    lanes[lane] = sums;
    workgroupBarrier();
    for (var width = THREADS / 2u; width > 0u; width /= 2u) {
        if lane < width {
            lanes[lane] = add(lanes[lane], lanes[lane + width]);
        }
        workgroupBarrier();
    }
    if lane == 0u {
        tet_sums[id.x] = lanes[0];
    }
}
