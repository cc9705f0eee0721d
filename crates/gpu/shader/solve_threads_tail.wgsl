// Several colors of one group each, one after the other, in a single workgroup: a barrier within a
// workgroup costs less than a dispatch.

@compute @workgroup_size(64)
fn main(@builtin(local_invocation_index) lane: u32) {
    for (var index = 0u; index < dispatch_range.count; index++) {
        solve_group(lists[dispatch_range.first + index], lane);
        storageBarrier();
    }
}
