// The worklist of WLC in the order of the vertices, and the position of the chunk.

struct WlcWork {
    // Start of the list, 0 or the other half, and its length.
    begin: u32,
    count: u32,
    // Entries processed in this round, and the number of losers among them.
    done: u32,
    lost: u32,
    // Largest number of vertices in a chunk.
    chunk: u32,
    rounds: u32,
    list: array<u32>,
}

// The color of a vertex without one, or the pick of a vertex without one.
const NONE: u32 = 0xffffffffu;
