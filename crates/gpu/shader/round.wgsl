// What all kernels of a coloring see.

struct Round {
    vertices: u32,
    // Which of the two worklists is read.
    parity: u32,
}

@group(0) @binding(0) var<uniform> current: Round;
