// Several colors of one tile each, one after the other, in a single workgroup.

@compute @workgroup_size(64)
fn main(@builtin(local_invocation_index) lane: u32) {
    for (var index = 0u; index < dispatch_range.count; index++) {
        solve_tile(lists[dispatch_range.first + index], lane);
        storageBarrier();
        workgroupBarrier();
    }
}
