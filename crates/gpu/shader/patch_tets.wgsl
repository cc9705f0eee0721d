// Scatters tets to their slots after a cut.

struct TetPatch {
    tet_slot: u32,
    unused: array<u32, 3>,
    corners: vec4<u32>,
    rest: array<f32, 16>,
    constants: vec4<f32>,
}

@group(0) @binding(0) var<uniform> dispatch_range: DispatchRange;
@group(0) @binding(1) var<storage, read> patches: array<TetPatch>;
@group(0) @binding(2) var<storage, read_write> corners: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> rest: array<f32>;
@group(0) @binding(4) var<storage, read_write> constants: array<vec4<f32>>;

override UNIFORM: bool = true;

const NUMBERS: u32 = 16u;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
) {
    let index = workgroup_index(id, count) * THREADS + lane;
    if index >= dispatch_range.count {
        return;
    }
    let slot = patches[index].tet_slot;
    corners[slot] = patches[index].corners;
    let at = (slot / THREADS) * (NUMBERS * THREADS) + slot % THREADS;
    for (var k = 0u; k < NUMBERS; k++) {
        rest[at + k * THREADS] = patches[index].rest[k];
    }
    if !UNIFORM {
        constants[slot] = patches[index].constants;
    }
}
