// Particles that hang on handles, and where their places are.

struct Attachment {
    // The place in the handle's frame, relative to the middle of all places there.
    place: vec3<f32>,
    particle: u32,
    handle: u32,
    // In m/N; 0 is rigid.
    compliance: f32,
    // Damping time in s.
    damping: f32,
    unused: u32,
}

// Three rows of a rotation with what is added to each.
struct Pose {
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
}

// Where a place is.
fn at_pose(pose: Pose, place: vec3<f32>) -> vec3<f32> {
    return vec3(
        dot(pose.x.xyz, place) + pose.x.w,
        dot(pose.y.xyz, place) + pose.y.w,
        dot(pose.z.xyz, place) + pose.z.w,
    );
}
