// The smallest color that no neighbor in a row has.
//
// Searches in windows of 64 colors, which needs no storage and does not limit the number of colors.
// The including shader defines `color_around`. Cost: one walk over the row per window, mostly one
// window.

fn first_fit(begin: u32, end: u32) -> u32 {
    var base = 0u;
    var free = vec2<u32>(0u, 0u);
    loop {
        free = vec2<u32>(0xffffffffu, 0xffffffffu);
        for (var i = begin; i < end; i++) {
            let color = color_around(i) - base;
            if color < 32u {
                free.x &= ~(1u << color);
            } else if color < 64u {
                free.y &= ~(1u << (color - 32u));
            }
        }
        if any(free != vec2<u32>(0u, 0u)) {
            break;
        }
        base += 64u;
    }
    if free.x != 0u {
        return base + countTrailingZeros(free.x);
    }
    return base + 32u + countTrailingZeros(free.y);
}
