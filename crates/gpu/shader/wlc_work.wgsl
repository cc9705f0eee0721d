// The worklist of WLC, in the order of the vertices, and how far the chunks have come.

struct WlcWork {
    // Where the list starts, at 0 or in the other half, and its length.
    begin: u32,
    count: u32,
    // Entries done in this round, and how many of them have lost.
    done: u32,
    lost: u32,
    // How many choose at the same time.
    chunk: u32,
    rounds: u32,
    list: array<u32>,
}

// No color yet, or none picked.
const NONE: u32 = 0xffffffffu;
