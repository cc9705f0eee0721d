//! Animated GIF ("Graphics Interchange Format, version 89a", 1990).
//!
//! A picture has a palette of its own for the pixels that changed; the others are transparent. Palettes are exact where
//! there are few colors, else found by a self-organizing net (A. Dekker, "Kohonen neural networks for optimal colour
//! quantization", 1994) through `color_quant`.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufWriter, Write};

use color_quant::NeuQuant;
use gif::{DisposalMethod, Encoder, EncodingError, Frame, Repeat};

use super::{Rectangle, around};
use crate::Picture;

/// Colors of a picture, and the number of the one that is none.
const COLORS: usize = 255;
const TRANSPARENT: u8 = 255;
/// Every how many pixels the net learns from, 1 to 30.
const SAMPLING: i32 = 7;
/// What channels may differ by without being stored: less than palettes do.
const TOLERANCE: u8 = 2;

/// A file of pictures.
pub(super) struct Gif {
    encoder: Encoder<BufWriter<File>>,
    size: [u32; 2],
}

impl std::fmt::Debug for Gif {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gif").field("size", &self.size).finish()
    }
}

impl Gif {
    pub(super) fn new(file: File, size: [u32; 2]) -> io::Result<Self> {
        let [width, height] = size.map(side);
        let encoder = Encoder::new(BufWriter::new(file), width, height, &[]);
        let mut encoder = encoder.map_err(why)?;
        encoder.set_repeat(Repeat::Infinite).map_err(why)?;
        Ok(Self { encoder, size })
    }

    pub(super) fn push(
        &mut self,
        picture: &Picture,
        shown: &mut Vec<u8>,
        delay: u16,
    ) -> io::Result<()> {
        let differs = |a: &[u8], b: &[u8]| {
            let channels = a.iter().zip(b);
            channels.fold(0, |most, (a, b)| a.abs_diff(*b).max(most)) > TOLERANCE
        };
        let first = shown.is_empty();
        let part = if first {
            shown.resize(picture.rgba.len(), 0);
            Rectangle::whole(self.size)
        } else {
            around(shown, &picture.rgba, self.size[0], differs)
        };
        // The colors that are stored, one after the other, and where.
        let mut colors = Vec::new();
        let mut stored = Vec::new();
        for row in part.rows(self.size[0]) {
            let now = picture.rgba[row.clone()].chunks_exact(4);
            for (before, now) in shown[row].chunks_exact_mut(4).zip(now) {
                let store = first || differs(before, now);
                stored.push(store);
                if store {
                    colors.extend_from_slice(now);
                    before.copy_from_slice(now);
                }
            }
        }
        let (palette, indices) = reduce(&colors);
        let mut indices = indices.into_iter();
        let pixels = stored.into_iter().map(|store| match store {
            true => indices.next().unwrap_or(TRANSPARENT),
            false => TRANSPARENT,
        });
        let frame = Frame {
            delay,
            dispose: DisposalMethod::Keep,
            transparent: Some(TRANSPARENT),
            left: side(part.left),
            top: side(part.top),
            width: side(part.width),
            height: side(part.height),
            palette: Some(palette),
            buffer: pixels.collect::<Vec<u8>>().into(),
            ..Frame::default()
        };
        self.encoder.write_frame(&frame).map_err(why)
    }

    pub(super) fn finish(self) -> io::Result<()> {
        self.encoder.into_inner().map_err(why)?.flush()
    }
}

/// A palette of 256 colors, the last for what is transparent, and the number of each pixel's color in it.
fn reduce(rgba: &[u8]) -> (Vec<u8>, Vec<u8>) {
    let pixels = || rgba.chunks_exact(4).map(|p| [p[0], p[1], p[2]]);
    // The number of each color so far; never iterated.
    let mut numbers: HashMap<[u8; 3], u8> = HashMap::new();
    let mut palette = Vec::new();
    let exact: Option<Vec<u8>> = pixels()
        .map(|color| {
            if let Some(&number) = numbers.get(&color) {
                return Some(number);
            }
            let number = u8::try_from(palette.len() / 3).ok();
            let number = number.filter(|&number| number < TRANSPARENT)?;
            palette.extend(color);
            numbers.insert(color, number);
            Some(number)
        })
        .collect();
    let indices = exact.unwrap_or_else(|| {
        let net = NeuQuant::new(SAMPLING, COLORS, rgba);
        palette = net.color_map_rgb();
        numbers.clear();
        let nearest = |[r, g, b]: [u8; 3]| u8::try_from(net.index_of(&[r, g, b, 255])).unwrap_or(0);
        pixels()
            .map(|color| *numbers.entry(color).or_insert_with(|| nearest(color)))
            .collect()
    });
    palette.resize(3 * 256, 0);
    (palette, indices)
}

/// What was checked to fit when the film was begun.
fn side(pixels: u32) -> u16 {
    u16::try_from(pixels).unwrap_or(u16::MAX)
}

fn why(error: EncodingError) -> io::Error {
    match error {
        EncodingError::Io(error) => error,
        other => io::Error::other(other.to_string()),
    }
}
