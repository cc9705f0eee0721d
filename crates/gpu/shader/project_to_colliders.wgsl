// Projects particles inside of colliders to their surface, with Coulomb friction. Twin: `collider.rs` and
// `collider/solid.rs` of incise-xpbd, which explain it; the order of operations is equal.

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(2) var<storage, read_write> particles: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> previous: array<vec4<f32>>;
// The colliders of all substeps, one substep after the other; `Solver::collider_data` documents the numbers.
@group(0) @binding(4) var<storage, read> colliders: array<f32>;

// The last digit of a number near 1.
const EPSILON: f32 = 1.1920929e-7;
// Numbers of a collider.
const NUMBERS: u32 = 22u;
// Passes over the colliders for a particle that is inside of several.
const ROUNDS: u32 = 32u;

const PLANE: f32 = 0.0;
const ROUND: f32 = 1.0;

struct Nearest {
    normal: vec3<f32>,
    distance: f32,
    point: vec3<f32>,
}

fn vector(at: u32) -> vec3<f32> {
    return vec3(colliders[at], colliders[at + 1u], colliders[at + 2u]);
}

fn nearest_on_plane(at: u32, x: vec3<f32>) -> Nearest {
    let normal = vector(at + 8u);
    let offset = colliders[at + 2u];
    let along = dot(normal, x);
    // Not `x` plus the depth, so that the particle lies exactly on a level surface.
    return Nearest(normal, along - offset, x - normal * along + normal * offset);
}

fn nearest_on_capsule(at: u32, x: vec3<f32>) -> Nearest {
    let radius = colliders[at + 2u];
    let start = vector(at + 8u);
    let axis = vector(at + 11u);
    let part = clamp(dot(x - start, axis) * colliders[at + 3u], 0.0, 1.0);
    let center = start + axis * part;
    let away = direction(x - center);
    let normal = select(vector(at + 14u), away.xyz, away.w > 0.0);
    return Nearest(normal, away.w - radius, center + normal * radius);
}

fn nearest_on_box(at: u32, x: vec3<f32>) -> Nearest {
    let half = vec3(colliders[at + 2u], colliders[at + 3u], colliders[at + 7u]);
    let center = vector(at + 8u);
    let axes = mat3x3(vector(at + 11u), vector(at + 14u), vector(at + 17u));
    let away = x - center;
    let local = vec3(dot(axes[0], away), dot(axes[1], away), dot(axes[2], away));
    var point = clamp(local, -half, half);
    let outside = direction(local - point);
    var normal = outside.xyz;
    var distance = outside.w;
    if !(distance > 0.0) {
        let beyond = abs(local) - half;
        let side = select(vec3(1.0), vec3(-1.0), local < vec3(0.0));
        point = local;
        if beyond.y > beyond.x && beyond.y >= beyond.z {
            normal = vec3(0.0, side.y, 0.0);
            distance = beyond.y;
            point.y = side.y * half.y;
        } else if beyond.z > beyond.x && beyond.z > beyond.y {
            normal = vec3(0.0, 0.0, side.z);
            distance = beyond.z;
            point.z = side.z * half.z;
        } else {
            normal = vec3(side.x, 0.0, 0.0);
            distance = beyond.x;
            point.x = side.x * half.x;
        }
    }
    return Nearest(
        axes[0] * normal.x + axes[1] * normal.y + axes[2] * normal.z,
        distance,
        center + (axes[0] * point.x + axes[1] * point.y + axes[2] * point.z),
    );
}

fn nearest(at: u32, x: vec3<f32>) -> Nearest {
    let kind = colliders[at];
    if kind == PLANE {
        return nearest_on_plane(at, x);
    }
    if kind == ROUND {
        return nearest_on_capsule(at, x);
    }
    return nearest_on_box(at, x);
}

// The distance from the surface, zero or negative, that a particle may keep which was at `before` before the substep.
fn kept_distance(at: u32, before: vec3<f32>) -> f32 {
    let kept = colliders[at + 20u];
    if kept <= 0.0 {
        return 0.0;
    }
    let x = before + vector(at + 4u);
    let distance = nearest(at, x).distance;
    let rounding = sqrt(x.x * x.x + x.y * x.y + x.z * x.z) * EPSILON * 4.0;
    return select(0.0, kept * distance, distance < -(colliders[at + 21u] + rounding));
}

// Reduces the motion along the surface by at most the depth of the correction times the friction coefficient.
fn rub(at: u32, surface: Nearest, kept: f32, before: vec3<f32>, x: vec3<f32>) -> vec3<f32> {
    let way = x - before - vector(at + 4u);
    let slide = way - surface.normal * dot(surface.normal, way);
    let length = sqrt(dot(slide, slide));
    let hold = colliders[at + 1u] * (kept - surface.distance);
    var share = settings.one;
    if length > hold {
        share = hold / length;
    }
    return surface.point + surface.normal * kept - slide * share;
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
) {
    let p = workgroup_index(id, count) * THREADS + lane;
    if p >= settings.particles {
        return;
    }
    let particle = particles[p];
    // Updating velocities resets NaN.
    if !(particle.w > 0.0) || !are_finite(particle.xyz) {
        return;
    }
    let before = previous[p].xyz;
    let number = settings.colliders;
    let first = current.substep * number;
    var x = particle.xyz;
    var moved = false;
    // Consecutive colliders that do not contain the particle.
    var clear = 0u;
    for (var k = 0u; k < ROUNDS * number; k++) {
        let at = (first + k % number) * NUMBERS;
        let surface = nearest(at, x);
        clear += 1u;
        if surface.distance < 0.0 {
            let kept = kept_distance(at, before);
            if surface.distance < kept {
                x = rub(at, surface, kept, before, x);
                clear = 1u;
                moved = true;
            }
        }
        if clear == number {
            break;
        }
    }
    if moved {
        particles[p] = vec4(x, particle.w);
    }
}
