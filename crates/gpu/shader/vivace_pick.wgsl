// First part of a round of Vivace (Fratarcangeli, Tibaldo and Pellacini 2016): every uncolored vertex picks a
// color at random.
//
// The random number is a hash of seed, vertex and round, so it is equal on all devices.

@group(0) @binding(2) var<uniform> settings: VivaceSettings;
@group(0) @binding(3) var<storage, read> offsets: array<u32>;
@group(0) @binding(4) var<storage, read_write> palettes: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> picked: array<u32>;

// The color of v with `rank` smaller ones before it, which must exist.
fn nth(v: u32, rank: u32) -> u32 {
    var left = rank;
    let begin = palette_begin(v);
    let words = palette_begin(v + 1u) - begin;
    for (var word = 0u; word < words; word++) {
        var bits = atomicLoad(&palettes[begin + word]);
        let count = countOneBits(bits);
        if left < count {
            for (; left > 0u; left--) {
                bits &= bits - 1u;
            }
            return word * 32u + countTrailingZeros(bits);
        }
        left -= count;
    }
    return NONE;
}

fn pick(v: u32) -> u32 {
    var colors = 0u;
    for (var word = palette_begin(v); word < palette_begin(v + 1u); word++) {
        colors += countOneBits(atomicLoad(&palettes[word]));
    }
    if colors == 0u {
        return NONE;
    }
    let seed = vec2<u32>(settings.seed_low, settings.seed_high ^ work.rounds);
    let draw = scramble(scramble(seed) ^ vec2<u32>(v, 0u));
    return nth(v, product_high(draw.y, colors));
}

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = workgroup_index(id, count) * THREADS + thread;
    if i < listed_count() {
        let v = listed(i);
        picked[v] = pick(v);
    }
}
