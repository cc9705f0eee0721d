//! [`Image`]: pixels in sRGB, and PNG files.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Write};
use std::path::Path;

use incise::mesh_io::{MeshIoError, write_atomically};

use crate::RenderError;
use crate::srgb::{decode, encode};

/// An image with pixels in sRGB.
///
/// # Example
/// ```
/// use incise_render::Image;
///
/// let path = std::env::temp_dir().join(format!("incise-render-doc-{}.png", std::process::id()));
/// let picture = Image::filled(4, 3, [200, 180, 160]);
/// picture.write_png(&path)?;
/// assert_eq!(Image::read_png(&path)?, picture);
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_render::RenderError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Four bytes per pixel, row by row from the top, opaque.
    pub rgba: Vec<u8>,
}

impl Image {
    /// Creates an image of one color.
    #[must_use]
    pub fn filled(width: u32, height: u32, [r, g, b]: [u8; 3]) -> Self {
        let pixels = width as usize * height as usize;
        Self {
            width,
            height,
            rgba: [r, g, b, 255].repeat(pixels),
        }
    }

    /// Color of a pixel, counted from the upper left.
    ///
    /// # Panics
    /// If the pixel is outside the image.
    #[must_use]
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 3] {
        assert!(x < self.width, "no such pixel");
        let at = 4 * (y as usize * self.width as usize + x as usize);
        [self.rgba[at], self.rgba[at + 1], self.rgba[at + 2]]
    }

    /// Downscales the image by `factor`: each pixel is the mean of a square of pixels in linear light. Pixels that do
    /// not fill a square at the right and lower edge are dropped. A factor of 0 or above a side changes nothing.
    #[must_use]
    pub fn shrunk(&self, factor: u32) -> Self {
        if factor == 0 || factor > self.width.min(self.height) {
            return self.clone();
        }
        let (width, height) = (self.width / factor, self.height / factor);
        let mut rgba = Vec::with_capacity(4 * width as usize * height as usize);
        let share = 1.0 / (factor * factor) as f32;
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let mut sum = [0.0_f32; 3];
            for (dy, dx) in (0..factor).flat_map(|dy| (0..factor).map(move |dx| (dy, dx))) {
                let pixel = self.pixel(x * factor + dx, y * factor + dy);
                for (sum, byte) in sum.iter_mut().zip(pixel) {
                    *sum += decode(byte);
                }
            }
            rgba.extend(sum.map(|sum| encode(sum * share)));
            rgba.push(255);
        }
        Self {
            width,
            height,
            rgba,
        }
    }

    /// Writes a PNG file through a temporary file, so that a failed write leaves no partial file under its name.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write_png(&self, path: impl AsRef<Path>) -> Result<(), RenderError> {
        atomically(path.as_ref(), |out| self.encode_png(out))
    }

    /// Writes the bytes of a PNG file, without the alpha channel. O(pixels).
    fn encode_png(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut encoder = png::Encoder::new(out, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::Fast);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.rgb())?;
        writer.finish()?;
        Ok(())
    }

    /// Converts to three bytes per pixel.
    pub(crate) fn rgb(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.rgba.len() / 4 * 3);
        for pixel in self.rgba.chunks_exact(4) {
            bytes.extend_from_slice(&pixel[..3]);
        }
        bytes
    }

    /// Reads a PNG file with eight bits per channel; of an animated PNG, the first image.
    ///
    /// # Errors
    /// If it cannot be read or is not such a file.
    pub fn read_png(path: impl AsRef<Path>) -> Result<Self, RenderError> {
        let path = path.as_ref();
        let read = || -> io::Result<Self> {
            let mut decoder = png::Decoder::new(BufReader::new(File::open(path)?));
            decoder
                .set_transformations(png::Transformations::ALPHA | png::Transformations::STRIP_16);
            let mut reader = decoder.read_info()?;
            let too_large = || io::Error::other("the picture is too large");
            let mut bytes = vec![0; reader.output_buffer_size().ok_or_else(too_large)?];
            let info = reader.next_frame(&mut bytes)?;
            bytes.truncate(info.buffer_size());
            if info.color_type == png::ColorType::GrayscaleAlpha {
                let spread = |pixel: &[u8]| [pixel[0], pixel[0], pixel[0], pixel[1]];
                bytes = bytes.chunks_exact(2).flat_map(spread).collect();
            }
            Ok(Self {
                width: info.width,
                height: info.height,
                rgba: bytes,
            })
        };
        read().map_err(|source| RenderError::Io {
            action: "read",
            path: path.to_owned(),
            source,
        })
    }
}

/// Writes a file completely or not at all.
pub(crate) fn atomically(
    path: &Path,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), RenderError> {
    let content = |out: &mut dyn Write| {
        let mut buffered = BufWriter::new(out);
        content(&mut buffered)?;
        buffered.flush()
    };
    write_atomically(path, content).map_err(|error| {
        let source = match error {
            MeshIoError::Io { source, .. } => source,
            other => io::Error::other(other.to_string()),
        };
        RenderError::Io {
            action: "write",
            path: path.to_owned(),
            source,
        }
    })
}
