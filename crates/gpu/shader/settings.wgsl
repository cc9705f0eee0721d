// Settings of a step for all kernels of the solver.

struct Settings {
    // Velocity added by gravity in a substep, in m/s.
    gravity: vec3<f32>,
    // The time of a substep in s, its square, and one over it.
    time: f32,
    time_squared: f32,
    per_time: f32,
    // Factor on each correction.
    relaxation: f32,
    // The numbers 1 and 1/2, and the norm of the derivative of det F above which volume terms are scaled down. They are
    // not literals, because some compilers reorder sums that contain literals.
    one: f32,
    half: f32,
    max_cofactor_norm: f32,
    particles: u32,
    // Tet slots per thread.
    depth: u32,
    // Numbers of colliders, handles, and rigid and soft attachments.
    colliders: u32,
    handles: u32,
    rigid: u32,
    soft: u32,
    // l/mu, gamma and the damping time of a single material; then 0, passed as a value to hide it from compilers.
    material: vec4<f32>,
}

// The entries of a list that one dispatch processes.
struct DispatchRange {
    first: u32,
    count: u32,
}

// Tests bits, since a compiler may assume that no value is infinite.
fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

fn are_finite(x: vec3<f32>) -> bool {
    return is_finite(x.x) && is_finite(x.y) && is_finite(x.z);
}
