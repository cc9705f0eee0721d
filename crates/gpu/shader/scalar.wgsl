// Scalar constraints on a few particles, in the order of their own schedule: a thread solves a cluster, constraint
// after constraint. Twin: `scalar.rs` of incise-xpbd, which explains the equations; the order of operations is equal.

override DAMPED: bool = false;
// True if multipliers are kept from one iteration to the next.
override KEEPS: bool = false;

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<uniform> dispatch_range: DispatchRange;
@group(0) @binding(2) var<storage, read_write> particles: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> previous: array<vec4<f32>>;
// Constraint -> particles; a distance uses the third number as a flag for tension only.
@group(0) @binding(4) var<storage, read> corners: array<vec4<u32>>;
// Constraint -> length or one over six volumes, compliance, damping time.
@group(0) @binding(5) var<storage, read> numbers: array<vec4<f32>>;
// Cluster -> its first constraint, and the end of its range.
@group(0) @binding(6) var<storage, read> ranges: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read_write> multipliers: array<f32>;
// The groups of 64 clusters of the colors.
@group(0) @binding(8) var<storage, read> lists: array<u32>;

// The change of the multiplier, which moves the particles along the gradients. `rate` is the change since the start of
// the substep.
fn solve(index: u32, value: f32, rate: f32, steepness: f32, one_sided: bool) -> f32 {
    let constraint = numbers[index];
    var before = 0.0;
    if KEEPS {
        before = multipliers[index];
    }
    let compliance = constraint.y / settings.time_squared;
    var residual = value + compliance * before;
    var resistance = steepness;
    if DAMPED {
        let damping = constraint.z * settings.per_time;
        residual += damping * rate;
        resistance *= settings.one + damping;
    }
    resistance += compliance;
    // All particles are fixed.
    if !(resistance > 0.0) {
        return 0.0;
    }
    var change = -(residual / resistance) * settings.relaxation;
    if one_sided {
        // A slack tension-only constraint neither pulls nor damps; its multiplier in total never pushes.
        if value <= 0.0 && change < 0.0 {
            return 0.0;
        }
        if before + change > 0.0 {
            change = -before;
        }
    }
    if !is_finite(change) {
        return 0.0;
    }
    if KEEPS {
        multipliers[index] = before + change;
    }
    return change;
}

fn solve_group(group: u32, lane: u32) {
    let range = ranges[group * THREADS + lane];
    for (var index = range.x; index < range.y; index++) {
        solve_constraint(index);
    }
}
