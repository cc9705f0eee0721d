// Numbers the colors in use in ascending order: one workgroup, each thread a range of colors.
//
// The number of colors is at most the largest degree plus one. Cost: O(colors / 64).

var<workgroup> used: array<u32, THREADS>;

@compute @workgroup_size(THREADS)
fn main(@builtin(local_invocation_index) thread: u32) {
    let colors = atomicLoad(&all.count);
    let part = (colors + THREADS - 1u) / THREADS;
    let begin = min(thread * part, colors);
    let end = min(begin + part, colors);
    var sum = 0u;
    for (var color = begin; color < end; color++) {
        sum += atomicLoad(&all.names[color]);
    }
    used[thread] = sum;
    workgroupBarrier();
    var name = 0u;
    for (var earlier = 0u; earlier < thread; earlier++) {
        name += used[earlier];
    }
    for (var color = begin; color < end; color++) {
        let is_used = atomicLoad(&all.names[color]);
        atomicStore(&all.names[color], name);
        name += is_used;
    }
    if thread == THREADS - 1u {
        atomicStore(&all.count, name);
    }
}
