// Chebyshev extrapolation of the multipliers. Twin: `Jacobi::extrapolate` of incise-xpbd.

@group(0) @binding(0) var<storage, read_write> multipliers: array<vec2<f32>>;
// Slot -> multipliers at the start of this iteration and at the start of the previous one.
@group(0) @binding(2) var<storage, read_write> history: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
) {
    let slot = workgroup_index(id, count) * THREADS + lane;
    if slot >= min(arrayLength(&multipliers), arrayLength(&history)) {
        return;
    }
    var multiplier = multipliers[slot];
    // A substep begins with multipliers of 0.
    var start = vec4(0.0);
    if current.iteration > 0u {
        start = history[slot];
    }
    if current.weight > 0.0 {
        multiplier = multiplier + (multiplier - start.zw) * (current.weight - 1.0);
        multipliers[slot] = multiplier;
    }
    // Only the tets change them, so the next iteration begins with these.
    history[slot] = vec4(multiplier, start.xy);
}
