// Moves rigidly attached particles to their handles at the end of a substep. Twin:
// `Solver::move_rigid_attachments` of incise-xpbd.

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(2) var<storage, read_write> particles: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> attachments: array<Attachment>;
// Poses at the start of the frame, then at the end of each substep.
@group(0) @binding(4) var<storage, read> poses: array<Pose>;
// The number of particles whose anchor was out of the range of numbers.
@group(0) @binding(5) var<storage, read_write> repaired: atomic<u32>;

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
    let attachment = attachments[index];
    let row = (current.substep + 1u) * settings.handles;
    let x = at_pose(poses[row + attachment.handle], attachment.anchor);
    if are_finite(x) {
        particles[attachment.particle] = vec4(x, particles[attachment.particle].w);
    } else {
        atomicAdd(&repaired, 1u);
    }
}
