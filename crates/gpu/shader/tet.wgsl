// A tet: deformation gradient, Cholesky factor of the metric and volume term.
// Shared by the kernels that solve tets and the one that damps them.
// Twin: `simd_kernel.rs` of incise-xpbd, which explains the equations; the order of operations is equal.

struct Tet {
    // Gradients of the barycentric coordinates of corners 1 to 3.
    q1: vec3<f32>,
    q2: vec3<f32>,
    q3: vec3<f32>,
    // The Cholesky factor L of the weighted metric G: its diagonal, then yx, zx, zy.
    diagonal: vec3<f32>,
    below: vec3<f32>,
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

// Positions or velocities of the corners, and inverse masses.
struct Corners {
    x0: vec4<f32>,
    x1: vec4<f32>,
    x2: vec4<f32>,
    x3: vec4<f32>,
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

// A L.
fn times_factor(tet: Tet, m: Columns) -> Columns {
    return Columns(
        tet.diagonal.x * m.a + tet.below.x * m.b + tet.below.y * m.c,
        tet.diagonal.y * m.b + tet.below.z * m.c,
        tet.diagonal.z * m.c,
    );
}

// G : A^T A = |A L|^2 in units of the stiffness times time squared.
fn weighted(tet: Tet, m: Columns) -> f32 {
    let factored = times_factor(tet, m);
    return product(factored, factored) * settings.time_squared;
}

fn product(m: Columns, n: Columns) -> f32 {
    return dot(m.a, n.a) + dot(m.b, n.b) + dot(m.c, n.c);
}

fn scaled(m: Columns, factor: f32) -> Columns {
    return Columns(m.a * factor, m.b * factor, m.c * factor);
}

fn zero() -> Columns {
    return Columns(vec3(0.0), vec3(0.0), vec3(0.0));
}

// The derivative of the determinant.
fn cofactor_of(f: Columns) -> Columns {
    return Columns(cross(f.b, f.c), cross(f.c, f.a), cross(f.a, f.b));
}

// The derivative of det F, det F and gamma, scaled down where the norm of the first exceeds its limit.
fn volume(tet: Tet, f: Columns) -> Volume {
    var cofactor = cofactor_of(f);
    let square = product(cofactor, cofactor);
    var det = dot(f.a, cofactor.a);
    var gamma = tet.gamma;
    if square > settings.max_cofactor_norm * settings.max_cofactor_norm {
        let scale = settings.max_cofactor_norm / sqrt(square);
        cofactor = scaled(cofactor, scale);
        det *= scale;
        gamma *= scale;
    }
    return Volume(cofactor, det, gamma);
}
