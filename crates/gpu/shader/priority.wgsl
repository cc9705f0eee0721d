// The priority of vertices: most neighbors first, ties broken by a hash of the number (as in ECL-GC).
//
// The hash is a bijection, so there are no further ties. It is not stored, since computing it is faster than loading
// it.

fn hash(id: u32) -> u32 {
    let x = ((id >> 16u) ^ id) * 0x045d9f3bu;
    let y = ((x >> 16u) ^ x) * 0x045d9f3bu;
    return (y >> 16u) ^ y;
}

// True if u has priority over v.
fn precedes(u: u32, degree_of_u: u32, v: u32, degree_of_v: u32) -> bool {
    if degree_of_u != degree_of_v {
        return degree_of_u > degree_of_v;
    }
    return hash(u) > hash(v);
}
