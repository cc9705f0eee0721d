// Begins a substep without multipliers.

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read_write> multipliers: array<vec2<f32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
) {
    let place = workgroup_index(id, count) * THREADS + lane;
    if place < settings.places {
        multipliers[place] = vec2(0.0);
    }
}
