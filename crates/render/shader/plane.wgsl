// Half spaces: a patch of each plane with a grid that fades into the background. Twin: `plane` in shading.rs.

@group(0) @binding(1) var contact_shadow: texture_2d<f32>;
@group(0) @binding(2) var between: sampler;

const TABLE = vec3<f32>(0.62, 0.635, 0.66);
const TABLE_LINE = vec3<f32>(0.30, 0.32, 0.36);
// Half the side of the contact shadow's square, in radii.
const SHARE: f32 = 0.6;

struct Patch {
    // w: the radius.
    @location(0) center: vec4<f32>,
    // Unit vector along the grid; w: offset of the grid lines.
    @location(1) u: vec4<f32>,
    @location(2) v: vec4<f32>,
    // Grid spacing, opacity, 1 if the plane receives contact shadows.
    @location(3) numbers: vec4<f32>,
}

struct Seen {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) center: vec4<f32>,
    @location(1) @interpolate(flat) u: vec4<f32>,
    @location(2) @interpolate(flat) v: vec4<f32>,
    @location(3) @interpolate(flat) numbers: vec4<f32>,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32, grid: Patch) -> Seen {
    // Corners 0 1 2, 2 1 3.
    let second = select(index - 2u, 2u, index == 3u);
    let corner = select(index, select(second, 1u, index == 4u), index > 2u);
    let x = select(-1.0, 1.0, (corner & 1u) == 1u);
    let y = select(-1.0, 1.0, (corner & 2u) == 2u);
    let position = grid.center.xyz + (grid.u.xyz * x + grid.v.xyz * y) * grid.center.w;
    return Seen(view.clip * vec4<f32>(position, 1.0), grid.center, grid.u, grid.v, grid.numbers);
}

// Fraction of a pixel covered by the grid lines across an axis.
fn line(axis: vec4<f32>, spacing: f32, position: vec3<f32>, right: vec3<f32>, down: vec3<f32>) -> f32 {
    let at = (dot(position, axis.xyz) + axis.w) / spacing;
    let width = (abs(dot(right, axis.xyz)) + abs(dot(down, axis.xyz))) / spacing;
    let distance = abs(at - floor(at + 0.5));
    return (1.0 - smoothstep(0.4 * width, 1.3 * width, distance)) * (1.0 - smoothstep(0.08, 0.45, width));
}

@fragment
fn fragment(seen: Seen) -> @location(0) vec4<f32> {
    let ray = ray_through(seen.clip.xy);
    let normal = cross(seen.u.xyz, seen.v.xyz);
    let slope = dot(ray, normal);
    let depth = dot(seen.center.xyz, normal) / slope;
    let position = ray * depth;
    let away = length(position - seen.center.xyz) / seen.center.w;
    if !(depth > 0.0 && away < 1.0) {
        discard;
    }
    let fade = 1.0 - smoothstep(0.25, 1.0, away);
    let step_right = view.right.xyz * (2.0 * view.right.w / view.size.x);
    let step_down = view.up.xyz * (-2.0 * view.up.w / view.size.y);
    let right = (step_right - ray * (dot(step_right, normal) / slope)) * depth;
    let down = (step_down - ray * (dot(step_down, normal) / slope)) * depth;
    let lines = max(
        line(seen.u, seen.numbers.x, position, right, down),
        line(seen.v, seen.numbers.x, position, right, down),
    );
    // Sampled by all pixels: a texture sample in non-uniform control flow is undefined.
    let from_center = vec2<f32>(dot(position - seen.center.xyz, seen.u.xyz), dot(position - seen.center.xyz, seen.v.xyz));
    let at = from_center / (SHARE * seen.center.w) * 0.5 + 0.5;
    let dark = textureSampleLevel(contact_shadow, between, at, 0.0).x;
    let edge = 0.5 / vec2<f32>(textureDimensions(contact_shadow));
    let within = seen.numbers.z > 0.0 && all(at >= edge) && all(at <= 1.0 - edge);
    let shadow = select(0.0, dark, within);
    let color = mix(TABLE, TABLE_LINE, 0.55 * lines) * (1.0 - 0.62 * shadow);
    let opacity = seen.numbers.y;
    let cover = opacity + (1.0 - opacity) * max(0.8 * shadow, 0.35 * lines);
    return vec4<f32>(color, cover * fade);
}
