// Workgroups for so many threads, as a grid that no device refuses.

// Most workgroups along one axis.
const WIDEST: u32 = 65535u;

// Rows of equal length, like in the host's grid, so the last one may be longer than asked for.
fn grid(threads: u32) -> array<u32, 3> {
    let groups = threads / THREADS + u32(threads % THREADS > 0u);
    let rows = max((groups + WIDEST - 1u) / WIDEST, 1u);
    return array<u32, 3>((groups + rows - 1u) / rows, rows, 1u);
}
