// Search state of one undecided vertex.

struct Search {
    // Entries of its list of higher neighbors that are pending.
    left: u32,
    // Leading entries that do not block it from taking `passed_for`.
    passed: u32,
    passed_for: u32,
}
