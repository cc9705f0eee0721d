// Kinetic energy, first moment and largest speed, summed up by workgroups. Twin: `Solver::energy` and
// `Solver::max_speed` of incise-xpbd.

struct ParticleSums {
    // Positions relative to the origin times masses.
    moment: vec3<f32>,
    // Both in units of the mean mass.
    kinetic: f32,
    speed_squared: f32,
    unused: array<f32, 3>,
}

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read> particles: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> velocities: array<vec4<f32>>;
// In units of the mean mass; includes rigidly attached particles.
@group(0) @binding(3) var<storage, read> masses: array<f32>;
@group(0) @binding(4) var<storage, read_write> particle_sums: array<ParticleSums>;

// Moment and kinetic energy; square of the speed.
var<workgroup> lanes: array<vec4<f32>, THREADS>;
var<workgroup> speeds: array<f32, THREADS>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
) {
    var sums = vec4(0.0);
    var largest = 0.0;
    for (var p = id.x * THREADS + lane; p < settings.particles; p += count.x * THREADS) {
        let velocity = velocities[p].xyz;
        let square = dot(velocity, velocity);
        sums += masses[p] * vec4(particles[p].xyz, 0.5 * square);
        largest = max(largest, square);
    }
    lanes[lane] = sums;
    speeds[lane] = largest;
    workgroupBarrier();
    for (var width = THREADS / 2u; width > 0u; width /= 2u) {
        if lane < width {
            lanes[lane] += lanes[lane + width];
            speeds[lane] = max(speeds[lane], speeds[lane + width]);
        }
        workgroupBarrier();
    }
    if lane == 0u {
        particle_sums[id.x] = ParticleSums(lanes[0].xyz, lanes[0].w, speeds[0], array<f32, 3>());
    }
}
