//! [`index`]: sizes of the host as 32-bit numbers of the device.

/// The number of a slot, tet, constraint or range in 32 bits.
///
/// # Panics
/// With 2³² of them or more; buffers of a device are smaller.
pub(crate) fn index(value: usize) -> u32 {
    u32::try_from(value).expect("what a device holds is numbered in 32 bits")
}
