// The order in which vertices get to choose: most neighbors first, ties broken by a hash of the number (as ECL-GC).
//
// The hash is a bijection, so there are no further ties, and nothing has to be stored: the device computes a hash
// faster than it loads one.

fn hash(id: u32) -> u32 {
    let x = ((id >> 16u) ^ id) * 0x045d9f3bu;
    let y = ((x >> 16u) ^ x) * 0x045d9f3bu;
    return (y >> 16u) ^ y;
}

// Does u choose before v?
fn precedes(u: u32, degree_of_u: u32, v: u32, degree_of_v: u32) -> bool {
    if degree_of_u != degree_of_v {
        return degree_of_u > degree_of_v;
    }
    return hash(u) > hash(v);
}
