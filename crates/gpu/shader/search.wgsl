// Where the search of one undecided vertex stands.

struct Search {
    // Entries of its list of higher neighbors still to wait for.
    left: u32,
    // Leading entries known not to stop it from taking `passed_for`.
    passed: u32,
    passed_for: u32,
}
