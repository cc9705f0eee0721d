// Skin of the bodies, drawn from the solver's position buffer: each corner looks up its triangle.
//
// Normals come from the fixed-point sums of normals.wgsl. Edges of triangles, all or those on the rims of cuts, are drawn
// in the same pass: each corner carries its distance in pixels from the opposite edge, interpolated in screen space
// (J. Bærentzen et al., "Single-pass wireframe rendering", 2006).

// Relative to the origin of their part, in m; w is unused.
@group(0) @binding(1) var<storage, read> positions: array<vec4<f32>>;
// x: particle; y: part, and in the highest bit whether the vertex is on a cut face.
@group(0) @binding(2) var<storage, read> vertices: array<vec2<u32>>;
// Three vertices each.
@group(0) @binding(3) var<storage, read> triangles: array<u32>;
// The origins of parts relative to the eye.
@group(0) @binding(4) var<storage, read> parts: array<vec4<f32>>;
// Three sums per vertex.
@group(0) @binding(5) var<storage, read> sums: array<i32>;
// One color word per triangle.
@group(0) @binding(6) var<storage, read> colors: array<u32>;
// For each triangle its edges on the rim of a cut: bit k for the edge opposite to corner k.
@group(0) @binding(7) var<storage, read> rims: array<u32>;

const CUT: u32 = 0x80000000u;
// Distance in pixels from an edge that is not drawn.
const FAR: f32 = 1e6;

struct Seen {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(perspective, centroid) position: vec3<f32>,
    @location(1) @interpolate(perspective, centroid) normal: vec3<f32>,
    @location(2) @interpolate(flat) face: vec3<f32>,
    // w: the gloss, negative for cut faces.
    @location(3) @interpolate(flat) base: vec4<f32>,
    @location(4) @interpolate(linear, centroid) distances: vec3<f32>,
}

fn position_of(vertex: u32) -> vec3<f32> {
    let found = vertices[vertex];
    return positions[found.x].xyz + parts[found.y & ~CUT].xyz;
}

// Distances in pixels of the corners from the opposite edges; a large value if a corner is not in front of the eye.
fn heights(a: vec4<f32>, b: vec4<f32>, c: vec4<f32>) -> vec3<f32> {
    if min(a.z, min(b.z, c.z)) <= 0.0 {
        return vec3<f32>(FAR);
    }
    let scale = 0.5 * view.size;
    let pa = a.xy / a.w * scale;
    let pb = b.xy / b.w * scale;
    let pc = c.xy / c.w * scale;
    let area = abs((pb.x - pa.x) * (pc.y - pa.y) - (pb.y - pa.y) * (pc.x - pa.x));
    let edges = vec3<f32>(distance(pb, pc), distance(pc, pa), distance(pa, pb));
    return area / max(edges, vec3<f32>(1e-6));
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Seen {
    let triangle = index / 3u;
    let corner = index % 3u;
    let corners = vec3<u32>(triangles[3u * triangle], triangles[3u * triangle + 1u], triangles[3u * triangle + 2u]);
    let a = position_of(corners.x);
    let b = position_of(corners.y);
    let c = position_of(corners.z);
    let own = corners[corner];
    var seen: Seen;
    seen.position = position_of(own);
    seen.clip = view.clip * vec4<f32>(seen.position, 1.0);
    seen.face = direction(cross(direction(b - a), direction(c - a)));
    seen.normal = direction(vec3<f32>(f32(sums[3u * own]), f32(sums[3u * own + 1u]), f32(sums[3u * own + 2u])));
    let cut = (vertices[own].y & CUT) != 0u;
    var word = 0u;
    if (view.flags & 4u) != 0u {
        word = colors[triangle];
    }
    let base = skin_base(word, cut);
    seen.base = vec4<f32>(base.xyz, select(base.w, -base.w, cut));
    seen.distances = vec3<f32>(FAR);
    let all_drawn = (view.flags & 1u) != 0u;
    if all_drawn || rims[triangle] != 0u {
        let one = view.clip * vec4<f32>(a, 1.0);
        let two = view.clip * vec4<f32>(b, 1.0);
        let three = view.clip * vec4<f32>(c, 1.0);
        let all = heights(one, two, three);
        if all.x < FAR {
            let k = vec3<u32>(0u, 1u, 2u);
            let on_rim = (vec3<u32>(rims[triangle]) & (vec3<u32>(1u) << k)) != vec3<u32>(0u);
            let here = select(vec3<f32>(0.0), all, k == vec3<u32>(corner));
            seen.distances = select(vec3<f32>(FAR), here, vec3<bool>(all_drawn));
            seen.distances = select(seen.distances, RIM * here, on_rim);
        }
    }
    return seen;
}

@fragment
fn fragment(seen: Seen) -> @location(0) vec4<f32> {
    let smoothly = (view.flags & 2u) != 0u;
    let normal = skin_normal(seen.normal, seen.face, seen.base.w < 0.0, smoothly);
    let color = shade(seen.base.xyz, abs(seen.base.w), seen.position, normal, seen.face);
    return vec4<f32>(wire(color, max(seen.distances, vec3<f32>(0.0))), 1.0);
}
