// Ends a Jacobi pass: adds the gathered corrections and, with Chebyshev, extrapolates along the line through the
// iterate before last. Twin: `Jacobi::apply` and `Jacobi::extrapolate` of incise-xpbd.
//
// A Jacobi pass does not change the particles, so the iterate at the start of the iteration is still available.

// True if iterates are kept.
override KEEPS: bool = false;

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(2) var<storage, read_write> particles: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> corrections: array<vec4<f32>>;
// Positions at the start of the previous iteration.
@group(0) @binding(4) var<storage, read_write> before: array<vec4<f32>>;

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
    var x = particle.xyz + corrections[p].xyz;
    corrections[p] = vec4(0.0);
    if KEEPS {
        if current.weight > 0.0 {
            let start = before[p].xyz;
            x = x + (x - start) * (current.weight - 1.0);
        }
        before[p] = particle;
    }
    particles[p] = vec4(x, particle.w);
}
