// Moves every free particle by its velocity. Twin: `Solver::predict` of incise-xpbd.
//
// `update_velocities.wgsl` recomputes the prediction with the same bits. The explicit `fma` is
// rounded identically by all compilers.

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read_write> particles: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> previous: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> velocities: array<vec4<f32>>;

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
    previous[p] = particle;
    if particle.w > 0.0 {
        let velocity = velocities[p].xyz + settings.gravity;
        velocities[p] = vec4(velocity, 0.0);
        particles[p] = vec4(fma(velocity, vec3(settings.time), particle.xyz), particle.w);
    }
}
