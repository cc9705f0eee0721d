// State of an uncolored constraint between rounds.

struct Wait {
    // The colors of the window that are unavailable, a bit each.
    taken: array<atomic<u32>, 2>,
    // The neighbor that blocked it last, plus one.
    stopped_by: u32,
}
