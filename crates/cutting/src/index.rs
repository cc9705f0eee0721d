//! Numbers of 32 bits for places in arrays.

/// A position in an array.
///
/// # Panics
/// From 2³² on. The sizes that are accepted keep all arrays shorter.
pub(crate) fn index(position: usize) -> u32 {
    u32::try_from(position).expect("arrays have fewer than 2³² elements")
}
