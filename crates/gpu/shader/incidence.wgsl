// The constraints around each particle and the particles of each constraint: constraints that share
// a particle conflict.
//
// Each direction is one array of offsets, then values. The offsets count from the front of the
// array.

@group(0) @binding(2) var<storage, read> particles_of: array<u32>;
@group(0) @binding(3) var<storage, read> constraints_of: array<u32>;
