// Which constraints conflict, told by particles: those that share one.
//
// Rows of both directions, each in one array: offsets, then values, and the offsets count from the front of the array.

@group(0) @binding(2) var<storage, read> particles_of: array<u32>;
@group(0) @binding(3) var<storage, read> constraints_of: array<u32>;
