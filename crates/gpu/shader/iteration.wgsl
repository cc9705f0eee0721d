// Uniform of an iteration: its position in the frame and its extrapolation.

struct IterationUniform {
    // Both start at 0.
    substep: u32,
    iteration: u32,
    // Weight of the Chebyshev extrapolation; 0 is none.
    weight: f32,
    unused: u32,
}

@group(0) @binding(1) var<uniform> current: IterationUniform;
