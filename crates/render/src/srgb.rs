//! sRGB (IEC 61966-2-1): [`encode`] converts linear light to a byte, [`decode`] the reverse. Both use tables: `encode`
//! is within one level, `decode` is exact.

use std::sync::LazyLock;

/// Steps of the table: the darkest sRGB level is a step of 1/3295 in linear light.
const STEPS: f32 = 16_383.0;

/// Converts linear light to an sRGB byte; values are clamped to 0 to 1.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the table"
)]
pub(crate) fn encode(linear: f32) -> u8 {
    static TABLE: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let byte = |step: u16| {
            let c = f32::from(step) / STEPS;
            let encoded = if c <= 0.003_130_8 {
                12.92 * c
            } else {
                1.055 * c.powf(1.0 / 2.4) - 0.055
            };
            (encoded * 255.0).round() as u8
        };
        (0..=STEPS as u16).map(byte).collect()
    });
    TABLE[(linear.clamp(0.0, 1.0) * STEPS + 0.5) as usize]
}

/// Converts an sRGB byte to linear light.
pub(crate) fn decode(byte: u8) -> f32 {
    static TABLE: LazyLock<[f32; 256]> = LazyLock::new(|| {
        std::array::from_fn(|i| {
            let c = i as f32 / 255.0;
            if c <= 0.040_45 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        })
    });
    TABLE[usize::from(byte)]
}
