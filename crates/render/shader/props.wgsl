// Obstacles and blades: triangles with a normal and a color per corner.

struct Corner {
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    // sRGB; w: the gloss.
    @location(2) color: vec4<f32>,
}

struct Seen {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(perspective, centroid) position: vec3<f32>,
    @location(1) @interpolate(perspective, centroid) normal: vec3<f32>,
    @location(2) @interpolate(flat) color: vec4<f32>,
}

@vertex
fn vertex(corner: Corner) -> Seen {
    let color = vec4<f32>(decode(corner.color.xyz), corner.color.w);
    return Seen(view.clip * vec4<f32>(corner.position, 1.0), corner.position, corner.normal, color);
}

@fragment
fn fragment(seen: Seen) -> @location(0) vec4<f32> {
    let normal = direction(seen.normal);
    return vec4<f32>(shade(seen.color.xyz, seen.color.w, seen.position, normal, normal), 1.0);
}
