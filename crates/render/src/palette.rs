//! [`Legend`] and colors: hues for cluster numbers, a ramp for values.
//!
//! Unordered items get hues a golden angle apart, so that consecutive numbers are distinguishable, at equal lightness
//! in Oklab (B. Ottosson, "A perceptual color space for image processing", 2020). Values get a ramp from blue through
//! green and yellow to red. All colors are sRGB.

/// Meaning of the colors in an image, for a panel beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Legend {
    /// Value at the lower end; smaller values have its color.
    pub low: f64,
    /// Value at the upper end; larger values have its color.
    pub high: f64,
    /// True for a logarithmic scale.
    pub logarithmic: bool,
    /// Unit of the values; empty for dimensionless values.
    pub unit: &'static str,
}

/// Colors of the ramp at equal distances from its lower to its upper end.
const RAMP: [[u8; 3]; 6] = [
    [52, 66, 138],
    [58, 128, 170],
    [116, 182, 152],
    [226, 208, 116],
    [228, 138, 72],
    [186, 48, 52],
];

impl Legend {
    /// Color at a fraction of the ramp: 0 is the lower end, 1 the upper end.
    ///
    /// ```
    /// # use incise::{Scene, Simulation, scene::ShapeSpec};
    /// # use incise_render::{ColorBy, RenderScene};
    /// # let mut scene = Scene::built_in();
    /// # scene.body[0].shape = Some(ShapeSpec::new("box", 500));
    /// # let mut simulation = Simulation::new(&scene)?;
    /// let mut render_scene = RenderScene::new(&simulation, &scene);
    /// let legend = render_scene.color(&mut simulation, ColorBy::Stretch, None)?.expect("values");
    /// assert_eq!(legend.low, 1.0);
    /// assert!(legend.color(0.0)[2] > legend.color(1.0)[2], "from blue to red");
    /// # Ok::<(), incise_render::RenderError>(())
    /// ```
    #[must_use]
    pub fn color(&self, t: f64) -> [u8; 3] {
        let last = RAMP.len() - 1;
        let at = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) } * last as f64;
        let below = (0..last).rfind(|&i| i as f64 <= at).unwrap_or(0);
        let share = at - below as f64;
        let [from, to] = [RAMP[below], RAMP[below + 1]];
        std::array::from_fn(|i| {
            byte(f64::from(from[i]) + (f64::from(to[i]) - f64::from(from[i])) * share)
        })
    }

    /// Position of a value on the ramp, from 0 at the lower to 1 at the upper end.
    #[must_use]
    pub fn fraction(&self, value: f64) -> f64 {
        let share = if self.logarithmic {
            (value.max(f64::MIN_POSITIVE) / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        share.clamp(0.0, 1.0)
    }
}

/// Color of an item number; consecutive numbers are distinguishable.
pub(crate) fn distinct(number: u32) -> [u8; 3] {
    // Multiples of half the golden ratio: hues repeat only after long runs of numbers.
    let hue = (f64::from(number) * 0.618_033_988_749_894_9 + 0.08).fract();
    let lightness = [0.70, 0.60, 0.78][(number % 3) as usize];
    oklch(lightness, 0.115, hue * std::f64::consts::TAU)
}

/// Converts a color of Oklab to the nearest sRGB color.
fn oklch(lightness: f64, chroma: f64, hue: f64) -> [u8; 3] {
    let (a, b) = (chroma * hue.cos(), chroma * hue.sin());
    let cube = |x: f64| x * x * x;
    let l = cube(lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b);
    let m = cube(lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b);
    let s = cube(lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b);
    let linear = [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ];
    linear.map(|c| {
        let c = c.clamp(0.0, 1.0);
        let encoded = if c <= 0.003_130_8 {
            12.92 * c
        } else {
            1.055 * c.powf(1.0 / 2.4) - 0.055
        };
        byte(encoded * 255.0)
    })
}

/// Rounds to the nearest byte.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to a byte's range"
)]
fn byte(value: f64) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

/// Packs a color as four bytes of a word, red in the lowest, opaque.
pub(crate) fn pack([r, g, b]: [u8; 3]) -> u32 {
    u32::from_le_bytes([r, g, b, 255])
}

/// Legend for values from `low` to their 98th percentile, rounded up to a step so that it does not change from frame to
/// frame.
pub(crate) fn legend_from(low: f64, mut values: Vec<f64>, unit: &'static str) -> Legend {
    values.retain(|value| value.is_finite());
    let rank = values.len().saturating_sub(1) * 49 / 50;
    let most = if values.is_empty() {
        low
    } else {
        *values.select_nth_unstable_by(rank, f64::total_cmp).1
    };
    let above = (most - low).max(0.05);
    Legend {
        low,
        high: low + nice(above),
        logarithmic: false,
        unit,
    }
}

/// Logarithmic legend over six decades that ends above the largest value.
pub(crate) fn decades(values: &[f64], unit: &'static str) -> Legend {
    let largest = values.iter().copied().filter(|value| value.is_finite());
    let largest = largest.fold(0.0, f64::max).max(1e-300);
    let high = 10_f64.powf(largest.log10().ceil());
    Legend {
        low: high * 1e-6,
        high,
        logarithmic: true,
        unit,
    }
}

/// Smallest of 1, 2, 5 times a power of ten that is at least a positive value.
pub(crate) fn nice(value: f64) -> f64 {
    let power = 10_f64.powf(value.log10().floor());
    let steps = [1.0, 2.0, 5.0].map(|step| step * power);
    let enough = steps.into_iter().find(|step| *step >= value * (1.0 - 1e-9));
    enough.unwrap_or(10.0 * power)
}
