// Contacts: pairs of particles across a fresh cut, vertices against triangles, and edges against edges. A thread solves a
// contact; those of a dispatch, or of a step of a tail, share no particle. Twin: `contacts.rs` of incise-xpbd, which
// explains the equations; the order of operations is equal.

// True if multipliers are kept from one iteration to the next.
override KEEPS: bool = false;

// In place of a particle that a contact does not have.
const NONE: u32 = 0xffffffffu;
// The sine of the angle between two edges up to which they count as parallel, squared.
const PARALLEL_SQUARED: f32 = 0.0001;
// One over how many times the part of an overlap that is taken back a particle may be moved by.
const PER_MOVE: f32 = 0.25;
// The square of the depth under both planes at an edge up to which the one acts that takes less to satisfy, in lengths of
// the edge.
const SLIGHT: f32 = 1e-4;

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
// Contact -> the vertex and the corners of its triangle, the ends of two edges, or both particles of a pair and twice NONE;
// NONE first in an empty place.
@group(0) @binding(4) var<storage, read> corners: array<vec4<u32>>;
// Contact -> two vectors: the second plane in the basis of the triangle and the thickness, or the normal of a pair; the
// limit in that basis and its distance. Of two edges the normal and the thickness, and a distance below 0.
@group(0) @binding(5) var<storage, read> numbers: array<vec4<f32>>;
@group(0) @binding(6) var<uniform> law: ContactUniform;
// Contact -> the sums of a frame of the impulse and of its normal part.
@group(0) @binding(7) var<storage, read_write> impulses: array<vec4<f32>>;
// Contact -> the impulse of friction and the multiplier of the substep, negative on the second plane.
@group(0) @binding(8) var<storage, read_write> multipliers: array<vec4<f32>>;
// The groups of 64 contacts of the colors.
@group(0) @binding(9) var<storage, read> lists: array<u32>;

// A plane of a contact at the present positions. The gradient at each particle is the normal times its share.
struct Plane {
    normal: vec3<f32>,
    shares: vec4<f32>,
    is_second: bool,
    // False where a triangle has no normal, or a contact no second plane.
    exists: bool,
}

// A contact at the present positions.
struct Gap {
    plane: Plane,
    // Below 0 in an overlap.
    value: f32,
    // The value without the part of an old overlap that the substep leaves.
    residual: f32,
    // Whether the vertex is past the end of the surface, so that there is no contact whatever the residual says.
    is_past: bool,
}

// The particles of a contact, those that it does not have zero, and the numbers that describe it.
struct Contact {
    now: array<vec4<f32>, 4>,
    old: array<vec3<f32>, 4>,
    // False for a pair.
    has_four: bool,
    beyond: vec4<f32>,
    limit: vec4<f32>,
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

fn no_plane() -> Plane {
    return Plane(vec3(0.0), vec4(0.0), false, false);
}

fn basis_now(contact: Contact) -> Basis {
    let b = contact.now[1].xyz;
    return Basis(contact.now[2].xyz - b, contact.now[3].xyz - b, contact.now[0].xyz - b);
}

fn basis_old(contact: Contact) -> Basis {
    let b = contact.old[1];
    return Basis(contact.old[2] - b, contact.old[3] - b, contact.old[0] - b);
}

fn above(at: Basis, plane: Plane, thickness: f32) -> f32 {
    let foot = at.r + at.e1 * plane.shares.z + at.e2 * plane.shares.w;
    return dot(plane.normal, foot) - thickness;
}

// The weight of a corner from the side of the grown triangle, 0 beyond it.
fn from_side(weight: f32) -> f32 {
    if weight > -law.margin {
        return weight + law.margin;
    }
    return 0.0;
}

// The plane of the triangle.
fn own_plane(at: Basis) -> Plane {
    let face = direction(cross(at.e1, at.e2));
    if !(face.w > 0.0) {
        return no_plane();
    }
    var second = dot(cross(at.r, at.e2), face.xyz) / face.w;
    var third = dot(cross(at.e1, at.r), face.xyz) / face.w;
    let first = settings.one - second - third;
    if !(is_finite(first) && is_finite(second) && is_finite(third)) {
        return no_plane();
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
    let shares = vec4(settings.one, second + third - settings.one, -second, -third);
    return Plane(face.xyz, shares, false, true);
}

// A direction from its coefficients in the basis of the triangle.
fn combined(at: Basis, coefficients: vec3<f32>) -> vec4<f32> {
    let area = cross(at.e1, at.e2);
    return direction(at.e1 * coefficients.x + at.e2 * coefficients.y + area * coefficients.z);
}

// Where the vertex is along the edge from the first corner to the second; `along` is the direction and the length of it.
fn part_of_edge(at: Basis, along: vec4<f32>, low: f32, high: f32) -> f32 {
    var part = dot(at.r, along.xyz) / along.w;
    if part < low {
        part = low;
    }
    if part > high {
        part = high;
    }
    return part;
}

// The plane beyond the edge from the first corner to the second.
fn plane_beyond(at: Basis, beyond: vec3<f32>) -> Plane {
    if all(beyond == vec3(0.0)) {
        return no_plane();
    }
    let other = combined(at, beyond);
    let edge = direction(at.e1);
    if !(other.w > 0.0 && edge.w > 0.0) {
        return no_plane();
    }
    let part = part_of_edge(at, edge, -law.margin, settings.one + law.margin);
    let shares = vec4(settings.one, part - settings.one, -part, 0.0);
    return Plane(other.xyz, shares, true, true);
}

// Whether the vertex is past the end of the surface.
fn is_past(at: Basis, limit: vec4<f32>, thickness: f32) -> bool {
    if all(limit.xyz == vec3(0.0)) {
        return false;
    }
    let outward = combined(at, limit.xyz);
    let edge = direction(at.e1);
    if !(outward.w > 0.0 && edge.w > 0.0) {
        return false;
    }
    let part = part_of_edge(at, edge, 0.0, settings.one);
    return dot(outward.xyz, at.r - at.e1 * part) > limit.w + thickness;
}

fn gap_to(plane: Plane, value: f32, before: f32) -> Gap {
    return Gap(plane, value, new_part(value, before), false);
}

fn is_slight(before: f32, slight: f32) -> bool {
    return before >= 0.0 || before * before < slight;
}

fn face_gap(contact: Contact) -> Gap {
    let now = basis_now(contact);
    let old = basis_old(contact);
    let thickness = contact.beyond.w;
    let own = own_plane(now);
    if !own.exists {
        return Gap(own, 0.0, 0.0, false);
    }
    let before = above(old, own, thickness);
    var gap = gap_to(own, above(now, own, thickness), before);
    if gap.value < 0.0 {
        let beyond = plane_beyond(now, contact.beyond.xyz);
        if beyond.exists {
            let other_before = above(old, beyond, thickness);
            let other = gap_to(beyond, above(now, beyond, thickness), other_before);
            let slight = SLIGHT * dot(now.e1, now.e1);
            var acts = other_before > before;
            // Outside of one plane is outside: that one lets go of what it pressed.
            if other.value >= 0.0 {
                acts = true;
            } else if is_slight(before, slight) && is_slight(other_before, slight) {
                acts = other.residual > gap.residual;
            }
            if acts {
                gap = other;
            }
        }
    }
    gap.is_past = !(gap.residual >= 0.0) && is_past(now, contact.limit, thickness);
    return gap;
}

// The gap between two edges through their closest points.
fn edge_gap(contact: Contact) -> Gap {
    let none = Gap(no_plane(), 0.0, 0.0, false);
    let along = direction(contact.now[1].xyz - contact.now[0].xyz);
    let other = direction(contact.now[3].xyz - contact.now[2].xyz);
    if !(along.w > 0.0 && other.w > 0.0) {
        return none;
    }
    let across = cross(along.xyz, other.xyz);
    let square = dot(across, across);
    if !(square > PARALLEL_SQUARED) {
        return none;
    }
    let r = contact.now[0].xyz - contact.now[2].xyz;
    var first = -(dot(r, cross(other.xyz, across)) / square) / along.w;
    var second = -(dot(r, cross(along.xyz, across)) / square) / other.w;
    if !(is_finite(first) && is_finite(second)) {
        return none;
    }
    let one = settings.one;
    let is_past = !(first >= 0.0 && first <= one && second >= 0.0 && second <= one);
    first = max(first, 0.0);
    first = min(first, one);
    second = max(second, 0.0);
    second = min(second, one);
    let shares = vec4(one - first, first, second - one, -second);
    let plane = Plane(contact.beyond.xyz, shares, false, true);
    let now = (contact.now[0].xyz - contact.now[2].xyz)
        + (contact.now[1].xyz - contact.now[0].xyz) * shares.y
        + (contact.now[3].xyz - contact.now[2].xyz) * shares.w;
    let old = (contact.old[0] - contact.old[2])
        + (contact.old[1] - contact.old[0]) * shares.y
        + (contact.old[3] - contact.old[2]) * shares.w;
    let value = dot(plane.normal, now) - contact.beyond.w;
    let before = dot(plane.normal, old) - contact.beyond.w;
    return Gap(plane, value, new_part(value, before), is_past);
}

fn pair_plane(contact: Contact) -> Plane {
    let shares = vec4(-settings.one, settings.one, 0.0, 0.0);
    return Plane(contact.beyond.xyz, shares, false, true);
}

fn gap_of(contact: Contact) -> Gap {
    if contact.has_four {
        if contact.limit.w < 0.0 {
            return edge_gap(contact);
        }
        return face_gap(contact);
    }
    let plane = pair_plane(contact);
    let value = dot(plane.normal, contact.now[1].xyz - contact.now[0].xyz);
    let before = dot(plane.normal, contact.old[1] - contact.old[0]);
    return Gap(plane, value, new_part(value, before), false);
}

// The first or the second plane.
fn plane_of(contact: Contact, is_second: bool) -> Plane {
    if !contact.has_four {
        return pair_plane(contact);
    }
    if contact.limit.w < 0.0 {
        return edge_gap(contact).plane;
    }
    let now = basis_now(contact);
    if is_second {
        return plane_beyond(now, contact.beyond.xyz);
    }
    return own_plane(now);
}

// Whether there is no contact at present.
fn is_open(gap: Gap) -> bool {
    return gap.is_past || gap.residual >= 0.0;
}

// The contact after an impulse along a plane.
fn pushed(contact: Contact, shares: vec4<f32>, impulse: vec3<f32>) -> Contact {
    var moved = contact;
    for (var k = 0; k < 4; k++) {
        let x = contact.now[k];
        moved.now[k] = vec4(x.xyz + impulse * (x.w * shares[k]), x.w);
    }
    return moved;
}

fn store_contact(corner: vec4<u32>, contact: Contact) {
    particles[corner.x] = contact.now[0];
    particles[corner.y] = contact.now[1];
    if contact.has_four {
        particles[corner.z] = contact.now[2];
        particles[corner.w] = contact.now[3];
    }
}

fn solve_contact(index: u32) {
    let corner = corners[index];
    if corner.x == NONE {
        return;
    }
    let has_four = corner.z != NONE;
    var contact: Contact;
    contact.has_four = has_four;
    contact.now[0] = particles[corner.x];
    contact.now[1] = particles[corner.y];
    contact.old[0] = previous[corner.x].xyz;
    contact.old[1] = previous[corner.y].xyz;
    contact.beyond = numbers[2u * index];
    if has_four {
        contact.now[2] = particles[corner.z];
        contact.now[3] = particles[corner.w];
        contact.old[2] = previous[corner.z].xyz;
        contact.old[3] = previous[corner.w].xyz;
        contact.limit = numbers[2u * index + 1u];
    }
    var gap = gap_of(contact);
    if !gap.plane.exists || !is_finite(gap.residual) {
        return;
    }
    var multiplier = vec4(0.0);
    if KEEPS {
        multiplier = multipliers[index];
    }
    var before = abs(multiplier.w);
    var friction = multiplier.xyz;
    // Open, and no impulse to take back.
    if is_open(gap) && !(before > 0.0) {
        return;
    }
    let was_second = multiplier.w < 0.0;
    if before > 0.0 && (gap.is_past || gap.plane.is_second != was_second) {
        // What pressed along another plane, or on a surface that has ended, is taken back where it acted.
        let plane = plane_of(contact, was_second);
        let impulse = -(plane.normal * before + friction);
        if !plane.exists || !are_finite(impulse) {
            return;
        }
        contact = pushed(contact, plane.shares, impulse);
        store_contact(corner, contact);
        impulses[index] += vec4(impulse, -before);
        before = 0.0;
        friction = vec3(0.0);
        multipliers[index] = vec4(0.0);
        gap = gap_of(contact);
        if !gap.plane.exists || !is_finite(gap.residual) || is_open(gap) {
            return;
        }
    }
    let plane = gap.plane;
    let shares = plane.shares;
    var sum = contact.now[0].w * shares.x * shares.x
        + contact.now[1].w * shares.y * shares.y
        + contact.now[2].w * shares.z * shares.z
        + contact.now[3].w * shares.w * shares.w;
    // Nothing that could move it.
    if !(sum > 0.0) {
        return;
    }
    var most = 0.0;
    for (var k = 0; k < 4; k++) {
        most = max(most, contact.now[k].w * abs(shares[k]));
    }
    sum = max(sum, most * PER_MOVE);
    var change = -(gap.residual / sum);
    if before + change < 0.0 {
        change = -before;
    }
    if !is_finite(change) {
        return;
    }
    let pressure = before + change;
    var impulse = plane.normal * change;
    if law.friction > 0.0 {
        var slide = (contact.now[0].xyz - contact.old[0]) * shares.x
            + (contact.now[1].xyz - contact.old[1]) * shares.y;
        if has_four {
            slide = slide + (contact.now[2].xyz - contact.old[2]) * shares.z
                + (contact.now[3].xyz - contact.old[3]) * shares.w;
        }
        slide = slide - plane.normal * dot(plane.normal, slide);
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
    store_contact(corner, pushed(contact, shares, impulse));
    if KEEPS {
        multipliers[index] = vec4(friction, select(pressure, -pressure, plane.is_second));
    }
    impulses[index] += vec4(impulse, change);
}

fn solve_group(group: u32, lane: u32) {
    solve_contact(group * THREADS + lane);
}
