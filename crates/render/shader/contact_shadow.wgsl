// Contact shadow, seen from directly above: nearness to the ground of the lowest triangle above each texel, by a maximum
// blend. Twin: contact_shadow.rs.

@group(0) @binding(1) var<storage, read> positions: array<vec4<f32>>;
// x: particle; y: part, and in the highest bit whether the vertex is on a cut face.
@group(0) @binding(2) var<storage, read> vertices: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> triangles: array<u32>;
@group(0) @binding(4) var<storage, read> parts: array<vec4<f32>>;

struct Ground {
    // Relative to the eye; w: the radius.
    center: vec4<f32>,
    u: vec4<f32>,
    v: vec4<f32>,
    numbers: vec4<f32>,
}

@group(0) @binding(0) var<uniform> ground: Ground;

const SHARE: f32 = 0.6;
const FALLOFF: f32 = 0.05;

struct Seen {
    @builtin(position) clip: vec4<f32>,
    @location(0) height: f32,
}

fn put(vertex: u32) -> vec3<f32> {
    let found = vertices[vertex];
    let position = positions[found.x].xyz + parts[found.y & 0x7fffffffu].xyz - ground.center.xyz;
    let scale = 1.0 / (SHARE * ground.center.w);
    return vec3<f32>(
        dot(position, ground.u.xyz) * scale,
        dot(position, ground.v.xyz) * scale,
        dot(position, cross(ground.u.xyz, ground.v.xyz)),
    );
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Seen {
    let first = index - index % 3u;
    let a = put(triangles[first]);
    let b = put(triangles[first + 1u]);
    let c = put(triangles[first + 2u]);
    let mine = put(triangles[index]);
    let out = max(max(abs(a.xy), abs(b.xy)), abs(c.xy));
    // A triangle that reaches outside the square is dropped: all its corners become one point.
    let scale = select(1.0, 0.0, max(out.x, out.y) > 1.0);
    // Rows go along v.
    return Seen(vec4<f32>(mine.x * scale, -mine.y * scale, 0.5, 1.0), mine.z);
}

@fragment
fn fragment(seen: Seen) -> @location(0) vec4<f32> {
    let dark = exp(-max(seen.height, 0.0) / (FALLOFF * ground.center.w));
    return vec4<f32>(dark, 0.0, 0.0, 1.0);
}
