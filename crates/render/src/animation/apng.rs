//! Animated PNG (W3C, "Portable Network Graphics (PNG) Specification (Third Edition)", 2025, section 4.9).
//!
//! The `png` crate compresses each image; its data goes into the animation's chunks. The number of images is at the
//! start of the file and is written last.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};

use super::{Rectangle, around};
use crate::Image;

/// Time base of delays: units per second.
const PER_SECOND: u16 = 1000;

/// An animated PNG file that is being written.
#[derive(Debug)]
pub(super) struct Apng {
    file: BufWriter<File>,
    size: [u32; 2],
    /// File offset of the number of images.
    control: u64,
    /// Sequence number of the next animation chunk.
    sequence: u32,
}

impl Apng {
    pub(super) fn new(file: File, size: [u32; 2]) -> io::Result<Self> {
        let mut file = BufWriter::new(file);
        file.write_all(b"\x89PNG\r\n\x1a\n")?;
        let mut header = Vec::new();
        header.extend(size.iter().flat_map(|side| side.to_be_bytes()));
        // Eight bits, RGB, the only compression and filter methods, not interlaced.
        header.extend([8, 2, 0, 0, 0]);
        chunk(&mut file, b"IHDR", &header)?;
        chunk(&mut file, b"sRGB", &[0])?;
        let control = file.stream_position()?;
        chunk(&mut file, b"acTL", &[0; 8])?;
        Ok(Self {
            file,
            size,
            control,
            sequence: 0,
        })
    }

    pub(super) fn push(
        &mut self,
        picture: &Image,
        shown: &mut Vec<u8>,
        delay: u16,
    ) -> io::Result<()> {
        let first = shown.is_empty();
        let part = if first {
            Rectangle::whole(self.size)
        } else {
            around(shown, &picture.rgba, self.size[0], |a, b| a != b)
        };
        let mut control = self.next().to_be_bytes().to_vec();
        let bounds = [part.width, part.height, part.left, part.top];
        control.extend(bounds.iter().flat_map(|bound| bound.to_be_bytes()));
        control.extend(
            [delay, PER_SECOND]
                .iter()
                .flat_map(|part| part.to_be_bytes()),
        );
        // Dispose: leave the image; blend: overwrite.
        control.extend([0, 0]);
        chunk(&mut self.file, b"fcTL", &control)?;
        for data in compressed(picture, part)? {
            if first {
                chunk(&mut self.file, b"IDAT", &data)?;
            } else {
                let mut numbered = self.next().to_be_bytes().to_vec();
                numbered.extend(data);
                chunk(&mut self.file, b"fdAT", &numbered)?;
            }
        }
        shown.clone_from(&picture.rgba);
        Ok(())
    }

    pub(super) fn finish(mut self, pictures: u32) -> io::Result<()> {
        chunk(&mut self.file, b"IEND", &[])?;
        self.file.seek(SeekFrom::Start(self.control))?;
        // The second number, 0, makes it play forever.
        let control = [pictures, 0].map(u32::to_be_bytes).concat();
        chunk(&mut self.file, b"acTL", &control)?;
        self.file.flush()
    }

    fn next(&mut self) -> u32 {
        self.sequence += 1;
        self.sequence - 1
    }
}

/// Compressed data of a rectangle of an image, in the chunks that the `png` crate makes.
fn compressed(picture: &Image, part: Rectangle) -> io::Result<Vec<Vec<u8>>> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, part.width, part.height);
    encoder.set_color(png::ColorType::Rgb);
    let mut rgb = Vec::new();
    for row in part.rows(picture.width) {
        for pixel in picture.rgba[row].chunks_exact(4) {
            rgb.extend_from_slice(&pixel[..3]);
        }
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&rgb)?;
    writer.finish()?;
    // After the signature: length, name, data and checksum of each chunk.
    let mut rest = &file[8..];
    let mut data = Vec::new();
    while let Some((length, after)) = rest.split_first_chunk::<4>() {
        let length = u32::from_be_bytes(*length) as usize;
        if &after[..4] == b"IDAT" {
            data.push(after[4..4 + length].to_vec());
        }
        rest = &after[length + 8..];
    }
    Ok(data)
}

fn chunk(file: &mut impl Write, name: &[u8; 4], data: &[u8]) -> io::Result<()> {
    let length = u32::try_from(data.len()).map_err(io::Error::other)?;
    file.write_all(&length.to_be_bytes())?;
    file.write_all(name)?;
    file.write_all(data)?;
    let mut checksum = crc32fast::Hasher::new();
    checksum.update(name);
    checksum.update(data);
    file.write_all(&checksum.finalize().to_be_bytes())
}
