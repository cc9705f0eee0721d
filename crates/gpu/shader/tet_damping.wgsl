// Viscous damping of a tet: two implicit steps on the velocities of its corners. Twin: `Tets::damped_volume` and
// `Tets::damped_shear` in `simd_kernel.rs` of incise-xpbd, which explain the equations; the order of operations is the same.

// Positions and inverse masses.
@group(0) @binding(6) var<storage, read> particles: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> velocities: array<vec4<f32>>;

// A symmetric matrix: xx, yy, zz, then xy, xz, yz.
struct Symmetric {
    same: vec3<f32>,
    mixed: vec3<f32>,
}

// The symmetric part of A^T B.
fn symmetric(m: Columns, n: Columns) -> Symmetric {
    return Symmetric(
        vec3(dot(m.a, n.a), dot(m.b, n.b), dot(m.c, n.c)),
        vec3(
            dot(m.a, n.b) + dot(m.b, n.a),
            dot(m.a, n.c) + dot(m.c, n.a),
            dot(m.b, n.c) + dot(m.c, n.b),
        ) * settings.half,
    );
}

// A matrix times a symmetric one.
fn times_symmetric(m: Columns, s: Symmetric) -> Columns {
    return Columns(
        m.a * s.same.x + m.b * s.mixed.x + m.c * s.mixed.y,
        m.a * s.mixed.x + m.b * s.same.y + m.c * s.mixed.z,
        m.a * s.mixed.y + m.b * s.mixed.z + m.c * s.same.z,
    );
}

// A matrix times a factor, 0 where the factor is not finite.
fn scaled_if_finite(m: Columns, factor: f32) -> Columns {
    if !is_finite(factor) {
        return zero();
    }
    return scaled(m, factor);
}

// The change of velocities per weight by the viscosity of the volume.
fn damped_volume(tet: Tet, f: Columns, rate: Columns) -> Columns {
    let cofactor = volume(tet, f).cofactor;
    let viscosity = (tet.ratio - settings.one) * tet.damping;
    let m = viscosity * weighted(tet, cofactor);
    let d = -(viscosity * tet.stiffness * product(cofactor, rate)) / (m + settings.one);
    return scaled_if_finite(cofactor, d);
}

// The change of velocities per weight by the viscosity of shear.
fn damped_shear(tet: Tet, f: Columns, rate: Columns) -> Columns {
    let force = times_symmetric(f, symmetric(f, rate));
    let factored = times_factor(tet, force);
    let weighted = Columns(
        tet.diagonal.x * factored.a * settings.time_squared,
        (tet.below.x * factored.a + tet.diagonal.y * factored.b) * settings.time_squared,
        (tet.below.y * factored.a + tet.below.z * factored.b + tet.diagonal.z * factored.c) * settings.time_squared,
    );
    let change = symmetric(f, weighted);
    let off = dot(change.mixed, change.mixed);
    let square = dot(change.same, change.same) + off + off;
    let steepness = product(factored, factored) * settings.time_squared;
    let twice = tet.damping + tet.damping;
    let d = twice * tet.stiffness * steepness / (steepness + twice * square);
    if !(steepness > 0.0) {
        return zero();
    }
    return scaled_if_finite(force, -d);
}

// The velocities of the corners of a tet at positions `x` after one damping step; `v` has the inverse masses, too.
fn damp_tet(tet: Tet, x: Corners, v: Corners) -> Corners {
    let f = deformation(tet, x);
    let moved = move_corners(tet, v, damped_volume(tet, f, deformation(tet, v)));
    return move_corners(tet, moved, damped_shear(tet, f, deformation(tet, moved)));
}

// The velocity and the inverse mass of a particle.
fn weighted_velocity(p: u32) -> vec4<f32> {
    return vec4(velocities[p].xyz, particles[p].w);
}
