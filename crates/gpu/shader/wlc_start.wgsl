// Before the first round of WLC: all vertices are on the list.

@group(0) @binding(1) var<storage, read_write> work: WlcWork;
@group(0) @binding(2) var<uniform> settings: WlcSettings;
@group(0) @binding(3) var<storage, read_write> arguments: array<u32, 3>;
@group(0) @binding(4) var<storage, read_write> picked: array<u32>;
@group(0) @binding(5) var<storage, read_write> colors: array<u32>;

struct WlcSettings {
    chunk: u32,
}

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let v = workgroup_index(id, count) * THREADS + thread;
    if v < current.vertices {
        work.list[v] = v;
        picked[v] = NONE;
        colors[v] = NONE;
    }
    if v == 0u {
        work.begin = 0u;
        work.count = current.vertices;
        work.done = 0u;
        work.lost = 0u;
        work.chunk = settings.chunk;
        work.rounds = 0u;
        arguments = grid(min(settings.chunk, current.vertices));
    }
}
