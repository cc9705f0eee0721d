// Colors in use, and their new numbers without gaps.

struct Names {
    // The largest color plus one; then the number of colors in use.
    count: atomic<u32>,
    // For each color 1 if it is used, then its new number.
    names: array<atomic<u32>>,
}

@group(0) @binding(1) var<storage, read_write> all: Names;
