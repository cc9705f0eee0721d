//! Numbers of 32 bits for places in arrays.

/// A place in an array.
///
/// # Panics
/// From 2³² on. The sizes that are accepted keep all arrays shorter.
pub(crate) fn index(place: usize) -> u32 {
    u32::try_from(place).expect("arrays have fewer than 2^32 elements")
}

/// The number of a tet, of which the faces have numbers, too: four times that, and more.
///
/// # Panics
/// From 2³⁰ on.
pub(crate) fn tet_index(place: usize) -> u32 {
    u32::try_from(place)
        .ok()
        .filter(|&tet| tet < 1 << 30)
        .expect("fewer than 2^30 tets")
}
