// Uniform shared by all kernels of a coloring.

struct Round {
    vertices: u32,
    // The worklist that is read, 0 or 1.
    parity: u32,
}

@group(0) @binding(0) var<uniform> current: Round;
