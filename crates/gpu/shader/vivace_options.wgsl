// Options and marks of Vivace.

struct VivaceSettings {
    seed_low: u32,
    seed_high: u32,
    // A palette starts with degree / shrinking + 1 colors.
    shrinking: u32,
    // True if a pick is kept only by the highest of all uncolored neighbors.
    highest_of_all: u32,
}

// The pick of a vertex without one.
const NONE: u32 = 0xffffffffu;
