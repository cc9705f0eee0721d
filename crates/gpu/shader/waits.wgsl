// What a constraint without a color remembers from round to round.

struct Wait {
    // The colors of the window that it cannot get, a bit each.
    taken: array<atomic<u32>, 2>,
    // The neighbor that stopped it last, plus one.
    stopped_by: u32,
}
