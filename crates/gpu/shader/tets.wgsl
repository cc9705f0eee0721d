// The tets on the device, and the bindings that solving and damping share.
//
// A slot holds the numbers of a tet. Those of 64 slots are interleaved number by number, so that
// adjacent threads read adjacent words.

// True if the body has a single material.
override UNIFORM: bool = true;

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<uniform> dispatch_range: DispatchRange;
// Slot -> corners; all 0 for an empty slot.
@group(0) @binding(2) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> rest: array<f32>;
@group(0) @binding(4) var<storage, read> constants: array<vec4<f32>>;
// The groups or tiles of the colors.
@group(0) @binding(5) var<storage, read> lists: array<u32>;

const NUMBERS: u32 = 16u;

fn tet_at(slot: u32) -> Tet {
    let at = (slot / THREADS) * (NUMBERS * THREADS) + slot % THREADS;
    var material = settings.material;
    if !UNIFORM {
        material = constants[slot];
    }
    return Tet(
        vec3(rest[at], rest[at + THREADS], rest[at + 2u * THREADS]),
        vec3(rest[at + 3u * THREADS], rest[at + 4u * THREADS], rest[at + 5u * THREADS]),
        vec3(rest[at + 6u * THREADS], rest[at + 7u * THREADS], rest[at + 8u * THREADS]),
        vec3(rest[at + 9u * THREADS], rest[at + 10u * THREADS], rest[at + 11u * THREADS]),
        vec3(rest[at + 12u * THREADS], rest[at + 13u * THREADS], rest[at + 14u * THREADS]),
        rest[at + 15u * THREADS] * settings.time_squared,
        material.x,
        material.y,
        material.z * settings.per_time,
    );
}
