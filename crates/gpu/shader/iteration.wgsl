// Where in a frame an iteration is, for kernels that need to know.

struct IterationUniform {
    // Both from 0 on.
    substep: u32,
    iteration: u32,
    // How far Chebyshev's leap goes; 0 is no leap.
    weight: f32,
    unused: u32,
}

@group(0) @binding(1) var<uniform> current: IterationUniform;
