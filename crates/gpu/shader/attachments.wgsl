// Attached particles and their anchors on handles.

struct Attachment {
    // The anchor in the handle's frame, relative to the center of all anchors of the handle.
    anchor: vec3<f32>,
    particle: u32,
    handle: u32,
    // In m/N; 0 is rigid.
    compliance: f32,
    // Damping time in s.
    damping: f32,
    unused: u32,
}

// Three rows of a rotation, each with its component of the translation.
struct Pose {
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
}

// Position of an anchor in the world.
fn at_pose(pose: Pose, anchor: vec3<f32>) -> vec3<f32> {
    return vec3(
        dot(pose.x.xyz, anchor) + pose.x.w,
        dot(pose.y.xyz, anchor) + pose.y.w,
        dot(pose.z.xyz, anchor) + pose.z.w,
    );
}
