// The three forms of solving a tet. Each moves the corners and changes both multipliers. Twin: `simd_kernel.rs` of
// incise-xpbd, which explains the equations; the order of operations is the same.
//
// The energy of the split form is written in two ways to avoid cancellation both near rest and far from it.

const SPLIT: u32 = 0u;
const BLOCK: u32 = 1u;
const SEQUENTIAL: u32 = 2u;

override TET_SOLVE: u32 = SPLIT;
// True if a substep has several iterations, for the split form.
override ITERATED: bool = false;
// True if multipliers are kept.
override KEEPS: bool = false;

@group(0) @binding(6) var<storage, read_write> particles: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> multipliers: array<vec2<f32>>;

// The change of F per weight by one constraint, and the change of its multiplier.
struct Change {
    derivative: Columns,
    multiplier: f32,
}

// The trace of E beyond which the energy of shear is computed from it.
const LARGE_STRAIN: f32 = 2.0;
// Largest number of halvings of a step that raises the energy of its tet.
const SHORTENINGS: u32 = 3u;

// The parts of the energy of the split form.
struct Energies {
    // Psi_D / mu.
    shear: f32,
    // Its derivative.
    derivative: Columns,
    // The derivative of det F.
    cofactor: Columns,
    // det F - 1.
    bulge: f32,
    // True if a step may raise the energy.
    far: bool,
}

fn energies_of(f: Columns) -> Energies {
    var cofactor = cofactor_of(f);
    var bulge = dot(f.a, cofactor.a) - settings.one;
    let aa = dot(f.a, f.a) - settings.one;
    let bb = dot(f.b, f.b) - settings.one;
    let cc = dot(f.c, f.c) - settings.one;
    let ab = dot(f.a, f.b);
    let ac = dot(f.a, f.c);
    let bc = dot(f.b, f.c);
    let minor = bb * cc - bc * bc;
    let second = aa * (bb + cc) + minor - ab * ab - ac * ac;
    let third = aa * minor - ab * (ab * cc - bc * ac) + ac * (ab * bc - bb * ac);
    var shear = bulge * bulge - (second + third) * settings.half;
    let trace = aa + bb + cc;
    let square = product(cofactor, cofactor);
    let steep = square > settings.max_cofactor_norm * settings.max_cofactor_norm;
    if steep {
        let scale = settings.max_cofactor_norm / sqrt(square);
        cofactor = scaled(cofactor, scale);
        bulge *= scale;
    }
    let large = steep || trace > LARGE_STRAIN;
    if large {
        shear = trace * settings.half - bulge + bulge * bulge * settings.half;
    }
    let pressure = bulge - settings.one;
    let derivative = Columns(
        f.a + pressure * cofactor.a,
        f.b + pressure * cofactor.b,
        f.c + pressure * cofactor.c,
    );
    let far = large || (square < settings.one && square > 0.0);
    return Energies(shear, derivative, cofactor, bulge, far);
}

// The energy of a tet over mu V.
fn energy_of(tet: Tet, energies: Energies) -> f32 {
    let lame = tet.ratio - settings.one;
    return energies.shear + lame * settings.half * energies.bulge * energies.bulge;
}

// The fraction of a step to take: below 1 where the full step would raise the energy of a tet that is far from rest.
fn descent(tet: Tet, x: Corners, f: Columns, energies: Energies, change: Columns) -> f32 {
    let push = (tet.ratio - settings.one) * energies.bulge;
    let moved = deformation(tet, move_corners(tet, x, change));
    let stress = Columns(
        energies.derivative.a + push * energies.cofactor.a,
        energies.derivative.b + push * energies.cofactor.b,
        energies.derivative.c + push * energies.cofactor.c,
    );
    let way = Columns(moved.a - f.a, moved.b - f.b, moved.c - f.c);
    let before = energy_of(tet, energies);
    let slope = product(stress, way);
    var fraction = settings.one;
    for (var i = 0u; i < SHORTENINGS; i++) {
        let after = Columns(f.a + way.a * fraction, f.b + way.b * fraction, f.c + way.c * fraction);
        let rise = energy_of(tet, energies_of(after)) - before;
        if rise <= 0.0 {
            break;
        }
        let along = slope * fraction;
        let shorter = -(along * settings.half) / (rise - along) * fraction;
        fraction = select(0.0, shorter, shorter > 0.0);
    }
    return fraction;
}

// Moves the corners by a shear step of `shear_step` and by the volume constraint that sees this step. `factored` is A L for
// the derivative of the shear energy.
fn move_split(
    tet: Tet,
    x: Corners,
    f: Columns,
    energies: Energies,
    factored: Columns,
    shear_step: f32,
    multipliers: ptr<function, vec2<f32>>,
) -> Corners {
    let lame = tet.ratio - settings.one;
    let steep = times_factor(tet, energies.cofactor);
    let mixed = product(factored, steep) * settings.time_squared;
    let b = -(lame * (tet.stiffness * energies.bulge + shear_step * mixed) + (*multipliers).y);
    let r = lame * (product(steep, steep) * settings.time_squared);
    var change = b * decay(r);
    if ITERATED {
        change = b / (r + settings.one);
    }
    let along = shear_step * settings.relaxation;
    let d = change * settings.relaxation;
    if !is_finite(along + d) {
        return x;
    }
    (*multipliers).y += d;
    var moved = Columns(
        energies.derivative.a * along + energies.cofactor.a * d,
        energies.derivative.b * along + energies.cofactor.b * d,
        energies.derivative.c * along + energies.cofactor.c * d,
    );
    if !ITERATED && energies.far {
        let fraction = descent(tet, x, f, energies, moved);
        moved = scaled(moved, fraction);
        *multipliers *= fraction;
    }
    return move_corners(tet, x, moved);
}

// (1 - e^-r) / r, as a quotient that agrees up to r^2.
fn decay(r: f32) -> f32 {
    return (6.0 + r) / (6.0 + r * (4.0 + r));
}

// `decay` of r, but no more than the step that is stable in the stiffest direction of the tet, of which the trace of G is
// a bound.
fn bounded_decay(tet: Tet, r: f32) -> f32 {
    let d = tet.diagonal * tet.diagonal;
    let b = tet.below * tet.below;
    // One by one, as in the kernel of the processor.
    let trace = (d.x + d.y + d.z + b.x + b.y + b.z) * settings.time_squared;
    let above = 6.0 + r;
    return above / max(6.0 + r * (4.0 + r), (trace + trace) * above);
}

// The split form in a single iteration.
fn solve_split(tet: Tet, x: Corners, f: Columns, multipliers: ptr<function, vec2<f32>>) -> Corners {
    let energies = energies_of(f);
    let twice = energies.shear + energies.shear;
    let factored = times_factor(tet, energies.derivative);
    let steepness = product(factored, factored) * settings.time_squared;
    var fraction = bounded_decay(tet, steepness / twice);
    if !(energies.shear > 0.0) {
        fraction = 0.0;
    }
    let shear_step = -(tet.stiffness * fraction);
    if KEEPS {
        let change = shear_step * sqrt(max(twice, 0.0)) * settings.relaxation;
        if is_finite(change) {
            (*multipliers).x += change;
        }
    }
    return move_split(tet, x, f, energies, factored, shear_step, multipliers);
}

// The split form with accumulating multipliers, for several iterations.
fn solve_split_iterated(tet: Tet, x: Corners, f: Columns, multipliers: ptr<function, vec2<f32>>) -> Corners {
    let energies = energies_of(f);
    let positive = energies.shear > 0.0;
    let twice = select(settings.one, energies.shear + energies.shear, positive);
    let constraint = sqrt(twice);
    let factored = times_factor(tet, energies.derivative);
    let m = product(factored, factored) * settings.time_squared / twice;
    var d = -((tet.stiffness * constraint + (*multipliers).x) / (m + settings.one));
    if !positive || !is_finite(d) {
        d = 0.0;
    }
    (*multipliers).x += d * settings.relaxation;
    return move_split(tet, x, f, energies, factored, d / constraint, multipliers);
}

// Prevents compilers from reordering the factors of a product. At rest the determinant of the block form is a difference
// of equal products, and each order of factors has other rounding errors.
fn pinned(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ bitcast<u32>(settings.material.w));
}

// The block form: both constraints as one system.
fn solve_block(tet: Tet, x: Corners, f: Columns, multipliers: ptr<function, vec2<f32>>) -> Corners {
    let norm = sqrt(product(f, f));
    // At F = 0 the gradient has no direction; the tet stays until its neighbors move it.
    let directed = norm > 0.0;
    let scale = settings.one / select(settings.one, norm, directed);
    let v = volume(tet, f);
    let d = tet.diagonal;
    let n = tet.below;
    let trace = (d.x * d.x + (n.x * n.x + d.y * d.y) + (n.y * n.y + n.z * n.z + d.z * d.z)) * settings.time_squared;
    let m11 = pinned(weighted(tet, f) * scale * scale);
    let m22 = weighted(tet, v.cofactor);
    let m12 = trace * v.volume * scale;
    let hydrostatic = v.volume - v.gamma;
    let parallel = m11 * m22 - m12 * m12;
    // A negative value is rounding noise. An overflow is kept, and the tet does not move.
    let rest = select(parallel, 0.0, parallel < 0.0);
    let inverse = settings.one / (tet.ratio * (rest + m22) + m11 + settings.one);
    let b1 = -(tet.stiffness * norm + (*multipliers).x);
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

// The change of a multiplier that satisfies its constraint, whose derivative is `scale` times a matrix.
fn alone(derivative: Columns, scale: f32, stiffness: f32, constraint: f32, m: f32, multiplier: f32) -> Change {
    let b = -(stiffness * constraint + multiplier);
    let d = b / (m + settings.one) * settings.relaxation;
    if !is_finite(d) {
        return Change(zero(), 0.0);
    }
    return Change(scaled(derivative, d * scale), d);
}

fn solve_deviatoric(tet: Tet, x: Corners, f: Columns, multipliers: ptr<function, vec2<f32>>) -> Corners {
    let norm = sqrt(product(f, f));
    if !(norm > 0.0) {
        return x;
    }
    let scale = settings.one / norm;
    let m = weighted(tet, f) * scale * scale;
    let change = alone(f, scale, tet.stiffness, norm, m, (*multipliers).x);
    (*multipliers).x += change.multiplier;
    return move_corners(tet, x, change.derivative);
}

fn solve_hydrostatic(tet: Tet, x: Corners, f: Columns, multipliers: ptr<function, vec2<f32>>) -> Corners {
    let v = volume(tet, f);
    let constraint = v.volume - v.gamma;
    let m = weighted(tet, v.cofactor) * tet.ratio;
    let change = alone(v.cofactor, settings.one, tet.stiffness * tet.ratio, constraint, m, (*multipliers).y);
    (*multipliers).y += change.multiplier;
    return move_corners(tet, x, change.derivative);
}

// The corners of a tet after one solve. In a Jacobi pass all constraints see the corners `x`.
fn solve_tet(tet: Tet, x: Corners, jacobi: bool, multipliers: ptr<function, vec2<f32>>) -> Corners {
    let f = deformation(tet, x);
    if TET_SOLVE == SEQUENTIAL {
        let moved = solve_deviatoric(tet, x, f, multipliers);
        if jacobi {
            return solve_hydrostatic(tet, moved, f, multipliers);
        }
        return solve_hydrostatic(tet, moved, deformation(tet, moved), multipliers);
    }
    if TET_SOLVE == BLOCK {
        return solve_block(tet, x, f, multipliers);
    }
    if ITERATED {
        return solve_split_iterated(tet, x, f, multipliers);
    }
    return solve_split(tet, x, f, multipliers);
}
