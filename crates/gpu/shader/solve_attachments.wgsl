// Pulls particles of compliant attachments to their handles. Twin: `Solver::solve_attachments` of
// incise-xpbd.

// True if multipliers are kept from one iteration to the next.
override KEEPS: bool = false;

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(2) var<storage, read_write> particles: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> previous: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> attachments: array<Attachment>;
// Poses at the start of the frame, then at the end of each substep.
@group(0) @binding(5) var<storage, read> poses: array<Pose>;
@group(0) @binding(6) var<storage, read_write> multipliers: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
) {
    let index = workgroup_index(id, count) * THREADS + lane;
    if index >= settings.soft {
        return;
    }
    let attachment = attachments[index];
    let p = attachment.particle;
    let inverse_mass = particles[p].w;
    if !(inverse_mass > 0.0) {
        return;
    }
    let row = current.substep * settings.handles + attachment.handle;
    let start = at_pose(poses[row], attachment.anchor);
    let target_ = at_pose(poses[row + settings.handles], attachment.anchor);
    var multiplier = vec3(0.0);
    if KEEPS && current.iteration > 0u {
        multiplier = multipliers[index].xyz;
    }
    let x = particles[p].xyz;
    let compliance = attachment.compliance / settings.time_squared;
    let damping = attachment.damping * settings.per_time;
    let away = x - target_;
    let motion = away - (previous[p].xyz - start);
    let residual = away + multiplier * compliance + motion * damping;
    let share = settings.relaxation / ((settings.one + damping) * inverse_mass + compliance);
    var change = -(residual * share);
    if are_finite(change) {
        particles[p] = vec4(x + change * inverse_mass, inverse_mass);
    } else {
        change = vec3(0.0);
    }
    if KEEPS {
        multipliers[index] = vec4(multiplier + change, 0.0);
    }
}
