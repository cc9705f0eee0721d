// Adds the corrections of positions to the velocities, and resets particles that left the range of numbers. Twin:
// `Solver::update_velocities` of incise-xpbd, whose documentation explains why velocities are not motion over time.

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read_write> particles: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> previous: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> velocities: array<vec4<f32>>;
// The number of reset particles.
@group(0) @binding(4) var<storage, read_write> repaired: atomic<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
) {
    let p = workgroup_index(id, count) * THREADS + lane;
    if p >= settings.particles {
        return;
    }
    let particle = particles[p];
    let before = previous[p].xyz;
    var velocity = vec3(0.0);
    var lost = !are_finite(particle.xyz);
    if particle.w > 0.0 {
        let free = velocities[p].xyz;
        let predicted = fma(free, vec3(settings.time), before);
        let speed = free + (particle.xyz - predicted) * settings.per_time;
        lost = !are_finite(speed);
        if !lost {
            velocity = speed;
        }
    }
    velocities[p] = vec4(velocity, 0.0);
    if lost {
        particles[p] = vec4(before, particle.w);
        atomicAdd(&repaired, 1u);
    }
}
