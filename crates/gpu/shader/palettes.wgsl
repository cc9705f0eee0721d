// The colors that each vertex may still get: a bit per color, at least degree + 1 colors.
//
// The first word of v is number (offsets[v] >> 5) + v. The words up to that of v + 1 are enough, and no prefix sum is
// needed. Words are atomics because neighbors remove colors while others read; palettes only shrink, so a thread that
// reads an old word sees too many colors and waits for another round, which does not change its color. The including
// shader binds `offsets` and `palettes`.

fn palette_begin(v: u32) -> u32 {
    return (offsets[v] >> 5u) + v;
}

// Gives v the colors below `size`, which is at least 1.
fn palette_fill(v: u32, size: u32) {
    let begin = palette_begin(v);
    let words = palette_begin(v + 1u) - begin;
    for (var word = 0u; word < words; word++) {
        let bits = size - min(size, word * 32u);
        var mask = 0xffffffffu;
        if bits < 32u {
            mask = (1u << bits) - 1u;
        }
        atomicStore(&palettes[begin + word], mask);
    }
}

fn palette_contains(v: u32, color: u32) -> bool {
    let word = palette_begin(v) + (color >> 5u);
    if word >= palette_begin(v + 1u) {
        return false;
    }
    return ((atomicLoad(&palettes[word]) >> (color & 31u)) & 1u) == 1u;
}

// Removes a color from the palette of v if it is there.
fn palette_remove(v: u32, color: u32) {
    let word = palette_begin(v) + (color >> 5u);
    if word < palette_begin(v + 1u) {
        let bit = 1u << (color & 31u);
        // Most often it is absent, and a load is cheaper than an atomic operation.
        if (atomicLoad(&palettes[word]) & bit) != 0u {
            atomicAnd(&palettes[word], ~bit);
        }
    }
}

// The smallest color of v, known not to be below `least`; if the palette is empty, no color.
fn palette_first(v: u32, least: u32) -> u32 {
    let begin = palette_begin(v);
    let words = palette_begin(v + 1u) - begin;
    for (var word = least >> 5u; word < words; word++) {
        let bits = atomicLoad(&palettes[begin + word]);
        if bits != 0u {
            return word * 32u + countTrailingZeros(bits);
        }
    }
    return PENDING - 1u;
}
