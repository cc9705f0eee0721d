// What Vivace is asked for, and the marks it keeps.

struct VivaceSettings {
    seed_low: u32,
    seed_high: u32,
    // A palette starts with degree / shrinking + 1 colors.
    shrinking: u32,
    // Whether only the highest of all uncolored neighbors keeps what others picked, too.
    highest_of_all: u32,
}

// Nothing picked.
const NONE: u32 = 0xffffffffu;
