// Sets the velocity of rigidly attached particles to that of their handle in a substep. Twin:
// `Solver::update_rigid_attachments` of incise-xpbd.

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read> particles: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> previous: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> velocities: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> attachments: array<Attachment>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
) {
    let index = workgroup_index(id, count) * THREADS + lane;
    if index >= settings.rigid {
        return;
    }
    let p = attachments[index].particle;
    let velocity = (particles[p].xyz - previous[p].xyz) * settings.per_time;
    if are_finite(velocity) {
        velocities[p] = vec4(velocity, 0.0);
    }
}
