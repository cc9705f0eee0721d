// The Stable Neo-Hookean constraints of a tet: what moves its corners. Twin: `simd_kernel.rs` of incise-xpbd, which explains
// the equations; the order of operations is the same.

override DAMPED: bool = false;
override SEQUENTIAL: bool = false;

struct Tet {
    // Gradients of the barycentric coordinates of corners 1 to 3.
    q1: vec3<f32>,
    q2: vec3<f32>,
    q3: vec3<f32>,
    // The weighted metric: diagonal, and twice xy, xz, yz.
    same: vec3<f32>,
    mixed: vec3<f32>,
    // mu V times the square of the time.
    stiffness: f32,
    ratio: f32,
    gamma: f32,
    // Damping time over the time of a substep.
    damping: f32,
}

// The columns of a matrix.
struct Columns {
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
}

// Positions of the corners and their inverse masses.
struct Corners {
    x0: vec4<f32>,
    x1: vec4<f32>,
    x2: vec4<f32>,
    x3: vec4<f32>,
}

// What corrections came to.
struct Change {
    derivative: Columns,
    multiplier: f32,
}

struct Volume {
    cofactor: Columns,
    volume: f32,
    gamma: f32,
}

fn deformation(tet: Tet, x: Corners) -> Columns {
    let a = x.x1.xyz - x.x0.xyz;
    let b = x.x2.xyz - x.x0.xyz;
    let c = x.x3.xyz - x.x0.xyz;
    return Columns(
        a * tet.q1.x + b * tet.q2.x + c * tet.q3.x,
        a * tet.q1.y + b * tet.q2.y + c * tet.q3.y,
        a * tet.q1.z + b * tet.q2.z + c * tet.q3.z,
    );
}

fn move_corners(tet: Tet, x: Corners, change: Columns) -> Corners {
    let d1 = change.a * tet.q1.x + change.b * tet.q1.y + change.c * tet.q1.z;
    let d2 = change.a * tet.q2.x + change.b * tet.q2.y + change.c * tet.q2.z;
    let d3 = change.a * tet.q3.x + change.b * tet.q3.y + change.c * tet.q3.z;
    return Corners(
        vec4(x.x0.xyz - x.x0.w * (d1 + d2 + d3), x.x0.w),
        vec4(x.x1.xyz + x.x1.w * d1, x.x1.w),
        vec4(x.x2.xyz + x.x2.w * d2, x.x2.w),
        vec4(x.x3.xyz + x.x3.w * d3, x.x3.w),
    );
}

// G : A^T A in units of the stiffness times time squared.
fn weighted(tet: Tet, m: Columns) -> f32 {
    let same = tet.same.x * dot(m.a, m.a) + tet.same.y * dot(m.b, m.b) + tet.same.z * dot(m.c, m.c);
    let mixed = tet.mixed.x * dot(m.a, m.b) + tet.mixed.y * dot(m.a, m.c) + tet.mixed.z * dot(m.b, m.c);
    return (same + mixed) * settings.time_squared;
}

fn product(m: Columns, n: Columns) -> f32 {
    return dot(m.a, n.a) + dot(m.b, n.b) + dot(m.c, n.c);
}

fn difference(m: Columns, n: Columns) -> Columns {
    return Columns(m.a - n.a, m.b - n.b, m.c - n.c);
}

fn scaled(m: Columns, factor: f32) -> Columns {
    return Columns(m.a * factor, m.b * factor, m.c * factor);
}

fn zero() -> Columns {
    return Columns(vec3(0.0), vec3(0.0), vec3(0.0));
}

// The derivative of det F, det F and gamma, scaled down where the first is too long.
fn volume(tet: Tet, f: Columns) -> Volume {
    var cofactor = Columns(cross(f.b, f.c), cross(f.c, f.a), cross(f.a, f.b));
    let square = product(cofactor, cofactor);
    var det = dot(f.a, cofactor.a);
    var gamma = tet.gamma;
    if square > settings.steep * settings.steep {
        let scale = settings.steep / sqrt(square);
        cofactor = scaled(cofactor, scale);
        det *= scale;
        gamma *= scale;
    }
    return Volume(cofactor, det, gamma);
}

// Keeps compilers from multiplying this with something else first. At rest the determinant of the system is a difference
// of equal products, and another order of their factors is another noise.
fn pinned(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ bitcast<u32>(settings.material.w));
}

// Both constraints as one system; moves the corners and changes both multipliers.
fn solve_both(tet: Tet, x: Corners, f: Columns, old: Columns, multipliers: ptr<function, vec2<f32>>) -> Corners {
    let norm = sqrt(product(f, f));
    // Without a direction no correction is sound, and the tet waits for its neighbors.
    let directed = norm > 0.0;
    let scale = settings.one / select(settings.one, norm, directed);
    let v = volume(tet, f);
    let trace = (tet.same.x + tet.same.y + tet.same.z) * settings.time_squared;
    var m11 = pinned(weighted(tet, f) * scale * scale);
    var m22 = weighted(tet, v.cofactor);
    var m12 = trace * v.volume * scale;
    var deviatoric = norm;
    var hydrostatic = v.volume - v.gamma;
    if DAMPED {
        let motion = difference(f, old);
        deviatoric += tet.damping * scale * product(f, motion);
        hydrostatic += tet.damping * product(v.cofactor, motion);
        let damped = settings.one + tet.damping;
        m11 = pinned(m11 * damped);
        m22 = pinned(m22 * damped);
        m12 = pinned(m12 * damped);
    }
    let parallel = m11 * m22 - m12 * m12;
    // Where rounding makes it negative it is noise; what overflowed stays so.
    let rest = select(parallel, 0.0, parallel < 0.0);
    let inverse = settings.one / (tet.ratio * (rest + m22) + m11 + settings.one);
    let b1 = -(tet.stiffness * deviatoric + (*multipliers).x);
    let b2 = -(tet.stiffness * tet.ratio * hydrostatic + (*multipliers).y);
    let d1 = ((tet.ratio * m22 + settings.one) * b1 - m12 * b2) * inverse * settings.relaxation;
    let d2 = ((m11 + settings.one) * b2 - tet.ratio * m12 * b1) * inverse * settings.relaxation;
    if !directed || !is_finite(d1 + d2) {
        return x;
    }
    *multipliers += vec2(d1, d2);
    let along = d1 * scale;
    let change = Columns(
        f.a * along + v.cofactor.a * d2,
        f.b * along + v.cofactor.b * d2,
        f.c * along + v.cofactor.c * d2,
    );
    return move_corners(tet, x, change);
}

// The change of a multiplier that satisfies its constraint, whose derivative is `scale` times a matrix, times that.
fn alone(derivative: Columns, scale: f32, stiffness: f32, constraint: f32, m: f32, multiplier: f32) -> Change {
    let b = -(stiffness * constraint + multiplier);
    let d = b / (m + settings.one) * settings.relaxation;
    if !is_finite(d) {
        return Change(zero(), 0.0);
    }
    return Change(scaled(derivative, d * scale), d);
}

fn solve_deviatoric(tet: Tet, x: Corners, f: Columns, old: Columns, multipliers: ptr<function, vec2<f32>>) -> Corners {
    let norm = sqrt(product(f, f));
    if !(norm > 0.0) {
        return x;
    }
    let scale = settings.one / norm;
    var constraint = norm;
    var m = weighted(tet, f) * scale * scale;
    if DAMPED {
        constraint += tet.damping * scale * product(f, difference(f, old));
        m *= settings.one + tet.damping;
    }
    let change = alone(f, scale, tet.stiffness, constraint, m, (*multipliers).x);
    (*multipliers).x += change.multiplier;
    return move_corners(tet, x, change.derivative);
}

fn solve_hydrostatic(tet: Tet, x: Corners, f: Columns, old: Columns, multipliers: ptr<function, vec2<f32>>) -> Corners {
    let v = volume(tet, f);
    var constraint = v.volume - v.gamma;
    var m = weighted(tet, v.cofactor) * tet.ratio;
    if DAMPED {
        constraint += tet.damping * product(v.cofactor, difference(f, old));
        m *= settings.one + tet.damping;
    }
    let change = alone(v.cofactor, settings.one, tet.stiffness * tet.ratio, constraint, m, (*multipliers).y);
    (*multipliers).y += change.multiplier;
    return move_corners(tet, x, change.derivative);
}

// Solves a tet: where its corners go. `before` is where they were at the start of the substep, used with damping only.
// In a Jacobi pass both constraints see the same corners.
fn solve_tet(
    tet: Tet,
    x: Corners,
    before: Corners,
    jacobi: bool,
    multipliers: ptr<function, vec2<f32>>,
) -> Corners {
    let f = deformation(tet, x);
    var old = f;
    if DAMPED {
        old = deformation(tet, before);
    }
    if SEQUENTIAL {
        let moved = solve_deviatoric(tet, x, f, old, multipliers);
        if jacobi {
            return solve_hydrostatic(tet, moved, f, old, multipliers);
        }
        return solve_hydrostatic(tet, moved, deformation(tet, moved), old, multipliers);
    }
    return solve_both(tet, x, f, old, multipliers);
}
