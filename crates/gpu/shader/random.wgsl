// Stateless random numbers: a counter of 64 bits, scrambled (the output of SplitMix64; Steele, Lea
// and Flood 2014), as two words of 32 bits, the low one first.

// The high half of a product.
fn product_high(a: u32, b: u32) -> u32 {
    let a0 = a & 0xffffu;
    let a1 = a >> 16u;
    let b0 = b & 0xffffu;
    let b1 = b >> 16u;
    let middle = a1 * b0 + ((a0 * b0) >> 16u);
    let other = a0 * b1 + (middle & 0xffffu);
    return a1 * b1 + (middle >> 16u) + (other >> 16u);
}

// The lower 64 bits of a product.
fn product(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    return vec2<u32>(a.x * b.x, product_high(a.x, b.x) + a.x * b.y + a.y * b.x);
}

// x ^ (x >> bits), for 1 to 31 bits.
fn folded(x: vec2<u32>, bits: u32) -> vec2<u32> {
    return x ^ vec2<u32>((x.x >> bits) | (x.y << (32u - bits)), x.y >> bits);
}

// A bijection that scrambles all bits.
fn scramble(x: vec2<u32>) -> vec2<u32> {
    let y = product(folded(x, 30u), vec2<u32>(0x1ce4e5b9u, 0xbf58476du));
    let z = product(folded(y, 27u), vec2<u32>(0x133111ebu, 0x94d049bbu));
    return folded(z, 31u);
}
