// Contacts: pairs of particles across a fresh cut, and vertices against triangles. A thread solves a contact; those of a
// dispatch, or of a step of a tail, share no particle. Twin: `contacts.rs` of incise-xpbd, which explains the equations;
// the order of operations is equal.

// True if multipliers are kept from one iteration to the next.
override KEEPS: bool = false;

// In place of a particle that a contact does not have.
const NONE: u32 = 0xffffffffu;

struct ContactUniform {
    friction: f32,
    // The part of an old overlap that a substep leaves.
    kept: f32,
    // By how much the foot of a vertex may lie outside of a side of its triangle, in altitudes.
    margin: f32,
    unused: f32,
}

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<uniform> dispatch_range: DispatchRange;
@group(0) @binding(2) var<storage, read_write> particles: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> previous: array<vec4<f32>>;
// Contact -> the vertex and the corners of its triangle, or both particles of a pair and twice NONE; NONE first in an
// empty place.
@group(0) @binding(4) var<storage, read> corners: array<vec4<u32>>;
// Contact -> the second plane in the basis of the triangle and the thickness, or the normal of a pair.
@group(0) @binding(5) var<storage, read> numbers: array<vec4<f32>>;
@group(0) @binding(6) var<uniform> law: ContactUniform;
// Contact -> the sums of a frame of the impulse and of its normal part.
@group(0) @binding(7) var<storage, read_write> impulses: array<vec4<f32>>;
// Contact -> the impulse of friction and the multiplier of the substep.
@group(0) @binding(8) var<storage, read_write> multipliers: array<vec4<f32>>;
// The groups of 64 contacts of the colors.
@group(0) @binding(9) var<storage, read> lists: array<u32>;

// A contact at the present positions. The gradient at each particle is the normal times its share.
struct Gap {
    normal: vec3<f32>,
    residual: f32,
    shares: vec4<f32>,
    // False where a triangle has no normal.
    exists: bool,
}

// Both edges from the first corner of a triangle, and the vertex from there.
struct Basis {
    e1: vec3<f32>,
    e2: vec3<f32>,
    r: vec3<f32>,
}

// What is left of the gap without the part of an old overlap that the substep leaves.
fn new_part(value: f32, before: f32) -> f32 {
    if before < 0.0 {
        return value - law.kept * before;
    }
    return value;
}

fn pair_gap(normal: vec3<f32>, between: vec3<f32>, before: vec3<f32>) -> Gap {
    let residual = new_part(dot(normal, between), dot(normal, before));
    return Gap(normal, residual, vec4(-settings.one, settings.one, 0.0, 0.0), true);
}

fn above(at: Basis, normal: vec3<f32>, second: f32, third: f32, thickness: f32) -> f32 {
    return dot(normal, at.r - at.e1 * second - at.e2 * third) - thickness;
}

// The weight of a corner from the side of the grown triangle, 0 beyond it.
fn from_side(weight: f32) -> f32 {
    if weight > -law.margin {
        return weight + law.margin;
    }
    return 0.0;
}

fn face_gap(now: Basis, old: Basis, plane: vec4<f32>) -> Gap {
    let none = Gap(vec3(0.0), 0.0, vec4(0.0), false);
    let area = cross(now.e1, now.e2);
    let face = direction(area);
    if !(face.w > 0.0) {
        return none;
    }
    var second = dot(cross(now.r, now.e2), face.xyz) / face.w;
    var third = dot(cross(now.e1, now.r), face.xyz) / face.w;
    let first = settings.one - second - third;
    if !(is_finite(first) && is_finite(second) && is_finite(third)) {
        return none;
    }
    let margin = law.margin;
    if !(first >= -margin && second >= -margin && third >= -margin) {
        let a = from_side(first);
        let b = from_side(second);
        let c = from_side(third);
        let scale = (settings.one + margin + margin + margin) / (a + b + c);
        second = b * scale - margin;
        third = c * scale - margin;
    }
    let value = above(now, face.xyz, second, third, plane.w);
    let residual = new_part(value, above(old, face.xyz, second, third, plane.w));
    let own = Gap(
        face.xyz,
        residual,
        vec4(settings.one, second + third - settings.one, -second, -third),
        true,
    );
    if residual >= 0.0 || all(plane.xyz == vec3(0.0)) {
        return own;
    }
    let other = direction(now.e1 * plane.x + now.e2 * plane.y + area * plane.z);
    let edge = direction(now.e1);
    if !(other.w > 0.0 && edge.w > 0.0) {
        return own;
    }
    var part = dot(now.r, edge.xyz) / edge.w;
    if part < -margin {
        part = -margin;
    }
    let high = settings.one + margin;
    if part > high {
        part = high;
    }
    let height = above(now, other.xyz, part, 0.0, plane.w);
    let beyond = new_part(height, above(old, other.xyz, part, 0.0, plane.w));
    if beyond > residual {
        return Gap(other.xyz, beyond, vec4(settings.one, part - settings.one, -part, 0.0), true);
    }
    return own;
}

fn solve_contact(index: u32) {
    let corner = corners[index];
    if corner.x == NONE {
        return;
    }
    let is_face = corner.z != NONE;
    let a = particles[corner.x];
    let b = particles[corner.y];
    let old_a = previous[corner.x].xyz;
    let old_b = previous[corner.y].xyz;
    var c = vec4(0.0);
    var d = vec4(0.0);
    var old_c = vec3(0.0);
    var old_d = vec3(0.0);
    let plane = numbers[index];
    var gap: Gap;
    if is_face {
        c = particles[corner.z];
        d = particles[corner.w];
        old_c = previous[corner.z].xyz;
        old_d = previous[corner.w].xyz;
        let now = Basis(c.xyz - b.xyz, d.xyz - b.xyz, a.xyz - b.xyz);
        let old = Basis(old_c - old_b, old_d - old_b, old_a - old_b);
        gap = face_gap(now, old, plane);
    } else {
        gap = pair_gap(plane.xyz, b.xyz - a.xyz, old_b - old_a);
    }
    if !gap.exists || !is_finite(gap.residual) {
        return;
    }
    var multiplier = vec4(0.0);
    if KEEPS {
        multiplier = multipliers[index];
    }
    let before = multiplier.w;
    // Apart, and not to be let go of either.
    if !(gap.residual < 0.0 || before > 0.0) {
        return;
    }
    let shares = gap.shares;
    let sum = a.w * shares.x * shares.x
        + b.w * shares.y * shares.y
        + c.w * shares.z * shares.z
        + d.w * shares.w * shares.w;
    // Nothing that could move it.
    if !(sum > 0.0) {
        return;
    }
    var change = -(gap.residual / sum);
    if before + change < 0.0 {
        change = -before;
    }
    if !is_finite(change) {
        return;
    }
    let pressure = before + change;
    var impulse = gap.normal * change;
    var friction = multiplier.xyz;
    if law.friction > 0.0 {
        var slide = (a.xyz - old_a) * shares.x + (b.xyz - old_b) * shares.y;
        if is_face {
            slide = slide + (c.xyz - old_c) * shares.z + (d.xyz - old_d) * shares.w;
        }
        slide = slide - gap.normal * dot(gap.normal, slide);
        var wanted = friction - slide * (settings.one / sum);
        let length = sqrt(dot(wanted, wanted));
        let limit = law.friction * pressure;
        if length > limit {
            wanted = wanted * (limit / length);
        }
        impulse += wanted - friction;
        friction = wanted;
    }
    if !are_finite(impulse) {
        return;
    }
    particles[corner.x] = vec4(a.xyz + impulse * (a.w * shares.x), a.w);
    particles[corner.y] = vec4(b.xyz + impulse * (b.w * shares.y), b.w);
    if is_face {
        particles[corner.z] = vec4(c.xyz + impulse * (c.w * shares.z), c.w);
        particles[corner.w] = vec4(d.xyz + impulse * (d.w * shares.w), d.w);
    }
    if KEEPS {
        multipliers[index] = vec4(friction, pressure);
    }
    impulses[index] += vec4(impulse, change);
}

fn solve_group(group: u32, lane: u32) {
    solve_contact(group * THREADS + lane);
}
