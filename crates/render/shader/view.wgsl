// Uniforms shared by everything drawn in an image; `View` of view.rs. All positions are relative to the eye.

struct View {
    clip: mat4x4<f32>,
    // w: half the image width at a depth of 1.
    right: vec4<f32>,
    // w: half the image height at a depth of 1.
    up: vec4<f32>,
    forward: vec4<f32>,
    // Unit vector to the light.
    light: vec4<f32>,
    // In pixels.
    size: vec2<f32>,
    // 1: wireframe, 2: smooth, 4: triangles have colors.
    flags: u32,
    unused: u32,
}

@group(0) @binding(0) var<uniform> view: View;

// Ray through a position in the image, in pixels from its upper left corner; it ends at a depth of 1.
fn ray_through(at: vec2<f32>) -> vec3<f32> {
    let x = view.right.w * (2.0 * at.x / view.size.x - 1.0);
    let y = view.up.w * (1.0 - 2.0 * at.y / view.size.y);
    return view.forward.xyz + view.right.xyz * x + view.up.xyz * y;
}
