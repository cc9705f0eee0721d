//! Animated GIF ("Graphics Interchange Format, version 89a", 1990).
//!
//! Each image has its own palette for the changed pixels; the others are transparent.

use std::fs::File;
use std::io::{self, BufWriter, Write};

use gif::{DisposalMethod, Encoder, EncodingError, Frame, Repeat};

use super::reduce::{Reduced, reduce};
use super::{Rectangle, around};
use crate::Image;

/// Colors per image; also the index of the transparent color.
const COLORS: usize = 255;
const TRANSPARENT: u8 = 255;
/// Largest difference of a channel that is not stored: less than the error of palettes.
const TOLERANCE: u8 = 2;

/// An animated GIF file that is being written.
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
        picture: &Image,
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
        // Colors of the changed pixels in order, and their indices.
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
        let Reduced { palette, numbers } = reduce(&colors, COLORS);
        let mut palette = palette.concat();
        palette.resize(3 * 256, 0);
        let mut indices = numbers.into_iter();
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

/// Side of an image as stored; its range was checked when the file was created.
fn side(pixels: u32) -> u16 {
    u16::try_from(pixels).unwrap_or(u16::MAX)
}

fn why(error: EncodingError) -> io::Error {
    match error {
        EncodingError::Io(error) => error,
        other => io::Error::other(other.to_string()),
    }
}
