// Scatters added and changed particles of a cut or an edit.

struct ParticlePatch {
    particle: vec4<f32>,
    velocity: vec3<f32>,
    index: u32,
}

@group(0) @binding(0) var<uniform> dispatch_range: DispatchRange;
@group(0) @binding(1) var<storage, read> patches: array<ParticlePatch>;
@group(0) @binding(2) var<storage, read_write> particles: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> velocities: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
) {
    let index = workgroup_index(id, count) * THREADS + lane;
    if index >= dispatch_range.count {
        return;
    }
    let patch_ = patches[index];
    particles[patch_.index] = patch_.particle;
    velocities[patch_.index] = vec4(patch_.velocity, 0.0);
}
