// Colors whose gaps are to be closed.

struct Names {
    // The largest color plus one; then the number of colors that are used.
    count: atomic<u32>,
    // For each color whether it is used, then its new name.
    names: array<atomic<u32>>,
}

@group(0) @binding(1) var<storage, read_write> all: Names;
