//! [`contact_sheet`]: a grid of images with captions.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use crate::Image;

/// Pixels around each image.
const MARGIN: usize = 10;
/// Height of a caption line in pixels.
const LINE: usize = 20;
const PAPER: [u8; 3] = [250, 250, 251];
const INK: [u8; 3] = [40, 44, 52];

const WEIGHT: FontWeight = FontWeight::Regular;
const HEIGHT: RasterHeight = RasterHeight::Size16;

/// Arranges images in rows of `columns`, from the upper left, each with its caption below. All cells have the size of
/// the largest image; captions wider than a cell are truncated, and characters other than ASCII become `?`. Without
/// images or columns the sheet has margins only. O(pixels).
///
/// # Example
/// ```
/// use incise_render::{Image, contact_sheet};
///
/// let picture = Image::filled(80, 60, [120, 60, 50]);
/// let four = vec![(picture, "frame 0".to_owned()); 4];
/// let sheet = contact_sheet(&four, 3);
/// assert_eq!((sheet.width, sheet.height), (3 * 90 + 10, 2 * 90 + 10));
/// ```
#[must_use]
pub fn contact_sheet(pictures: &[(Image, String)], columns: usize) -> Image {
    let columns = columns.min(pictures.len()).max(1);
    let largest = |side: fn(&Image) -> u32| {
        let sides = pictures.iter().map(|(picture, _)| side(picture) as usize);
        sides.max().unwrap_or(0)
    };
    let width = largest(|picture| picture.width);
    let height = largest(|picture| picture.height);
    let cell = [width + MARGIN, height + LINE + MARGIN];
    let rows = pictures.len().div_ceil(columns);
    let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
    let mut sheet = Image::filled(
        side(MARGIN + columns * cell[0]),
        side(MARGIN + rows * cell[1]),
        PAPER,
    );
    for (i, (picture, caption)) in pictures.iter().enumerate() {
        let left = MARGIN + i % columns * cell[0];
        let top = MARGIN + i / columns * cell[1];
        let row = 4 * picture.width as usize;
        for (y, pixels) in picture.rgba.chunks_exact(row.max(1)).enumerate() {
            let start = 4 * ((top + y) * sheet.width as usize + left);
            sheet.rgba[start..start + row].copy_from_slice(pixels);
        }
        write(&mut sheet, caption, [left, top + height + 3], width);
    }
    sheet
}

/// Writes a line of text from a position on, truncated to the width.
fn write(sheet: &mut Image, text: &str, [left, top]: [usize; 2], width: usize) {
    let advance = get_raster_width(WEIGHT, HEIGHT);
    for (i, letter) in text.chars().take(width / advance).enumerate() {
        let drawn = get_raster(letter, WEIGHT, HEIGHT).or_else(|| get_raster('?', WEIGHT, HEIGHT));
        let Some(drawn) = drawn else {
            continue;
        };
        for (y, row) in drawn.rows().enumerate() {
            for (x, &share) in row.iter().enumerate() {
                let at = 4 * ((top + y) * sheet.width as usize + left + i * advance + x);
                for (channel, (paper, ink)) in PAPER.iter().zip(INK).enumerate() {
                    let share = u32::from(share);
                    let mixed = (u32::from(*paper) * (255 - share) + u32::from(ink) * share) / 255;
                    sheet.rgba[at + channel] = u8::try_from(mixed).unwrap_or(u8::MAX);
                }
            }
        }
    }
}
