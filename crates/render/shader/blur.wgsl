// A blur along rows, then along columns. Twin: `blurred` in contact_shadow.rs.

@group(0) @binding(0) var texels: texture_2d<f32>;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let x = select(-1.0, 3.0, index == 1u);
    let y = select(-1.0, 3.0, index == 2u);
    return vec4<f32>(x, y, 0.0, 1.0);
}

// Texels outside the texture count as 0.
fn texel(at: vec2<i32>) -> f32 {
    let side = vec2<i32>(textureDimensions(texels));
    if any(at < vec2<i32>(0)) || any(at >= side) {
        return 0.0;
    }
    return textureLoad(texels, at, 0).x;
}

fn blurred(at: vec2<i32>, step: vec2<i32>) -> vec4<f32> {
    var sum = texel(at) * 0.1624;
    sum += (texel(at + step) + texel(at - step)) * 0.1499;
    sum += (texel(at + 2 * step) + texel(at - 2 * step)) * 0.1179;
    sum += (texel(at + 3 * step) + texel(at - 3 * step)) * 0.0790;
    sum += (texel(at + 4 * step) + texel(at - 4 * step)) * 0.0451;
    sum += (texel(at + 5 * step) + texel(at - 5 * step)) * 0.0219;
    sum += (texel(at + 6 * step) + texel(at - 6 * step)) * 0.0050;
    return vec4<f32>(sum, 0.0, 0.0, 1.0);
}

@fragment
fn across(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    return blurred(vec2<i32>(at.xy), vec2<i32>(1, 0));
}

@fragment
fn down(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    return blurred(vec2<i32>(at.xy), vec2<i32>(0, 1));
}
