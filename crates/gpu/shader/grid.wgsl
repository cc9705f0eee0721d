// A grid of workgroups for a number of threads, within the limits of every device.

// Largest number of workgroups along one axis.
const WIDEST: u32 = 65535u;

// Rows have equal length, like those of the host's grid, so the last one may have surplus
// workgroups.
fn grid(threads: u32) -> array<u32, 3> {
    let groups = threads / THREADS + u32(threads % THREADS > 0u);
    let rows = max((groups + WIDEST - 1u) / WIDEST, 1u);
    return array<u32, 3>((groups + rows - 1u) / rows, rows, 1u);
}
