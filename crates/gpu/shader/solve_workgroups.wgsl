// One color: all its tiles at once, a workgroup for each.

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
) {
    let index = workgroup_index(id, count);
    if index >= dispatch_range.count {
        return;
    }
    solve_tile(lists[dispatch_range.first + index], lane);
}
