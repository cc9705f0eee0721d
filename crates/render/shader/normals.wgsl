// Vertex normals of the skin: sums of triangle normals weighted by the corner angle, in fixed point, so that the result
// does not depend on the order of the sum. Twin: normals.rs.

@group(0) @binding(0) var<storage, read> positions: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read> vertices: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> triangles: array<u32>;
@group(0) @binding(3) var<storage, read_write> sums: array<atomic<i32>>;
// x: number of triangles.
@group(0) @binding(4) var<uniform> count: vec4<u32>;

const UNIT: f32 = 1048576.0;
const PI: f32 = 3.14159265;

fn unit(v: vec3<f32>) -> vec3<f32> {
    // Longest part first: squares of small edges must not vanish.
    let largest = max(abs(v.x), max(abs(v.y), abs(v.z)));
    if largest > 0.0 {
        return normalize(v / largest);
    }
    return vec3<f32>(0.0);
}

fn add(vertex: u32, v: vec3<f32>) {
    let fixed = vec3<i32>(round(v * UNIT));
    atomicAdd(&sums[3u * vertex], fixed.x);
    atomicAdd(&sums[3u * vertex + 1u], fixed.y);
    atomicAdd(&sums[3u * vertex + 2u], fixed.z);
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let triangle = (group.y * groups.x + group.x) * 64u + local.x;
    if triangle >= count.x {
        return;
    }
    let corners = vec3<u32>(triangles[3u * triangle], triangles[3u * triangle + 1u], triangles[3u * triangle + 2u]);
    let a = positions[vertices[corners.x].x].xyz;
    let b = positions[vertices[corners.y].x].xyz;
    let c = positions[vertices[corners.z].x].xyz;
    let ab = unit(b - a);
    let bc = unit(c - b);
    let ca = unit(a - c);
    let normal = unit(cross(ab, -ca));
    if all(normal == vec3<f32>(0.0)) {
        // Zero area; edges may have length 0, for which atan2 is undefined.
        return;
    }
    // Angle between two directions from sine and cosine.
    let at_a = atan2(length(cross(ab, -ca)), dot(ab, -ca));
    let at_b = atan2(length(cross(bc, -ab)), dot(bc, -ab));
    let at_c = PI - at_a - at_b;
    add(corners.x, normal * at_a);
    add(corners.y, normal * at_b);
    add(corners.z, normal * at_c);
}
