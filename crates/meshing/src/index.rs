//! Conversion of array indices to 32 bits.

/// Converts an array index.
///
/// # Panics
/// For 2³² or more. Accepted mesh sizes keep all arrays shorter.
pub(crate) fn index(place: usize) -> u32 {
    u32::try_from(place).expect("arrays have fewer than 2^32 elements")
}

/// Converts the index of a tet; face numbers, four times the index and more, fit too.
///
/// # Panics
/// For 2³⁰ or more.
pub(crate) fn tet_index(place: usize) -> u32 {
    u32::try_from(place)
        .ok()
        .filter(|&tet| tet < 1 << 30)
        .expect("fewer than 2^30 tets")
}
