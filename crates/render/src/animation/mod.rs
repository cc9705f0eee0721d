//! [`Animation`]: images written as an animated GIF or PNG.
//!
//! Each image is stored as its difference from the previous one, so that an animation with a still background stays
//! small: a PNG stores the rectangle around the changes without loss; a GIF stores the changed pixels with 255 colors
//! per image. Only one image is held in memory. The file has a temporary name while it is written and gets its final
//! name when it is finished. Cost: O(pixels) per image.

mod apng;
mod gif;
mod reduce;

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::{Image, RenderError};
use apng::Apng;
use gif::Gif;

/// Supported file extensions.
const KNOWN: &str = ".gif, .png, .apng";
/// Largest side of a picture in a GIF.
const LARGEST_GIF: u32 = 65_535;

/// An animated image that is being written; its file is removed if it is dropped before it is finished.
///
/// # Example
/// ```
/// use incise_render::{Animation, Image};
///
/// let path = std::env::temp_dir().join(format!("incise-render-doc-{}.gif", std::process::id()));
/// let mut film = Animation::create(&path, [8, 6], 0.1)?;
/// for step in 0..4 {
///     film.push(&Image::filled(8, 6, [40 * step, 90, 120]))?;
/// }
/// film.finish()?;
/// assert!(path.exists());
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_render::RenderError>(())
/// ```
#[derive(Debug)]
pub struct Animation {
    path: PathBuf,
    temporary: PathBuf,
    size: [u32; 2],
    seconds: f64,
    /// Images written so far.
    pictures: u32,
    /// Image shown after the last push: for a GIF, before its colors were reduced.
    shown: Vec<u8>,
    /// `None` once the animation is finished or a write failed.
    writer: Option<Writer>,
}

#[derive(Debug)]
enum Writer {
    Gif(Box<Gif>),
    Apng(Apng),
}

/// Rectangle of an image, in pixels.
#[derive(Clone, Copy, Debug)]
struct Rectangle {
    left: u32,
    top: u32,
    width: u32,
    height: u32,
}

impl Animation {
    /// Creates an animation of images of `size` pixels, each shown for `seconds_per_frame`, in a file whose extension
    /// selects the format: `.gif`, or `.png` or `.apng` for an animated PNG. It plays forever. Most viewers show an
    /// image of a GIF for at least 0.02 s.
    ///
    /// # Errors
    /// Before anything is written: if the extension is not supported; if a side of the images is 0 or, in a GIF, more
    /// than 65535; if the time is not from 0.01 s to 10 s; if the file cannot be created.
    pub fn create(
        path: impl AsRef<Path>,
        size: [u32; 2],
        seconds_per_frame: f64,
    ) -> Result<Self, RenderError> {
        let path = path.as_ref();
        let is_gif = is_gif(path)?;
        let largest = if is_gif { LARGEST_GIF } else { i32::MAX as u32 };
        if size.iter().any(|side| !(1..=largest).contains(side)) {
            return Err(RenderError::Size {
                width: size[0],
                height: size[1],
                range: format!("each side has from 1 to {largest} pixels in this kind of film"),
            });
        }
        if !(0.01..=10.0).contains(&seconds_per_frame) {
            return Err(RenderError::FrameTime {
                given: seconds_per_frame,
            });
        }
        static COUNTER: AtomicU32 = AtomicU32::new(0);
        let unique = COUNTER.fetch_add(1, Ordering::Relaxed);
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".partial-{}-{unique}", std::process::id()));
        let mut film = Self {
            path: path.to_owned(),
            temporary: path.with_file_name(name),
            size,
            seconds: seconds_per_frame,
            pictures: 0,
            shown: Vec::new(),
            writer: None,
        };
        let open = || {
            if path.is_dir() {
                return Err(io::Error::other("it is a folder"));
            }
            let file = File::create(&film.temporary)?;
            Ok(if is_gif {
                Writer::Gif(Box::new(Gif::new(file, size)?))
            } else {
                Writer::Apng(Apng::new(file, size)?)
            })
        };
        match open() {
            Ok(writer) => film.writer = Some(writer),
            Err(source) => return Err(film.failed(source)),
        }
        Ok(film)
    }

    /// Checks that a file name has a supported extension.
    ///
    /// # Errors
    /// If it has not: the message lists the supported extensions.
    pub fn check_path(path: impl AsRef<Path>) -> Result<(), RenderError> {
        is_gif(path.as_ref()).map(|_| ())
    }

    /// Adds an image.
    ///
    /// # Errors
    /// If its size is not that of the animation; if it cannot be written or an earlier write failed: the animation is
    /// then lost.
    pub fn push(&mut self, picture: &Image) -> Result<(), RenderError> {
        let Image { width, height, .. } = *picture;
        if [width, height] != self.size {
            return Err(RenderError::OtherSize {
                width,
                height,
                animation_width: self.size[0],
                animation_height: self.size[1],
            });
        }
        let (number, seconds) = (self.pictures, self.seconds);
        let written = match &mut self.writer {
            Some(Writer::Gif(gif)) => {
                let delay = ticks(number, seconds, 100.0);
                gif.push(picture, &mut self.shown, delay)
            }
            Some(Writer::Apng(apng)) => {
                let delay = ticks(number, seconds, 1000.0);
                apng.push(picture, &mut self.shown, delay)
            }
            None => Err(broken()),
        };
        if let Err(source) = written {
            // The file may end in part of an image and must not get its final name.
            self.writer = None;
            return Err(self.failed(source));
        }
        self.pictures += 1;
        Ok(())
    }

    /// Completes the animation and gives its file the final name.
    ///
    /// # Errors
    /// If it has no image, or if a write failed; no file is left then.
    pub fn finish(mut self) -> Result<(), RenderError> {
        if self.pictures == 0 {
            return Err(RenderError::EmptyFilm {
                path: self.path.clone(),
            });
        }
        let finished = match self.writer.take() {
            Some(Writer::Gif(gif)) => gif.finish(),
            Some(Writer::Apng(apng)) => apng.finish(self.pictures),
            None => Err(broken()),
        };
        let named = finished.and_then(|()| fs::rename(&self.temporary, &self.path));
        named.map_err(|source| self.failed(source))
    }

    fn failed(&self, source: io::Error) -> RenderError {
        RenderError::Io {
            action: "write",
            path: self.path.clone(),
            source,
        }
    }
}

impl Drop for Animation {
    fn drop(&mut self) {
        // Closed before it is removed: not every system removes an open file.
        self.writer = None;
        // The temporary file is already renamed if the animation was finished; other errors cannot be reported here.
        let _ = fs::remove_file(&self.temporary);
    }
}

/// Error of an animation after a failed write.
fn broken() -> io::Error {
    io::Error::other("an earlier picture could not be written")
}

fn is_gif(path: &Path) -> Result<bool, RenderError> {
    let ending = path.extension().unwrap_or_default();
    let is = |known: &str| ending.eq_ignore_ascii_case(known);
    if is("gif") {
        Ok(true)
    } else if is("png") || is("apng") {
        Ok(false)
    } else {
        Err(RenderError::UnknownAnimation {
            path: path.to_owned(),
            known: KNOWN,
        })
    }
}

/// Delay of the image of a given index in units of the time base; rounding errors do not add up.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "at most ten seconds of a thousand parts"
)]
fn ticks(number: u32, seconds: f64, per_second: f64) -> u16 {
    let until = |number: f64| (number * seconds * per_second).round();
    let number = f64::from(number);
    (until(number + 1.0) - until(number)).clamp(1.0, f64::from(u16::MAX)) as u16
}

/// Bounding rectangle of all pixels for which `differs` holds, given their four bytes before and now; the first pixel
/// if there are none.
fn around(
    before: &[u8],
    now: &[u8],
    width: u32,
    differs: impl Fn(&[u8], &[u8]) -> bool,
) -> Rectangle {
    let row = 4 * width as usize;
    let mut bounds: Option<[usize; 4]> = None;
    let rows = before.chunks_exact(row).zip(now.chunks_exact(row));
    for (y, (before, now)) in rows.enumerate() {
        let mut pixels = before.chunks_exact(4).zip(now.chunks_exact(4));
        let Some(first) = pixels.clone().position(|(a, b)| differs(a, b)) else {
            continue;
        };
        let last = pixels.rposition(|(a, b)| differs(a, b)).unwrap_or(first);
        bounds = Some(match bounds {
            None => [first, y, last, y],
            Some([left, top, right, _]) => [left.min(first), top, right.max(last), y],
        });
    }
    let [left, top, right, bottom] = bounds
        .unwrap_or_default()
        .map(|side| u32::try_from(side).expect("sides of pictures are counted in 32 bits"));
    Rectangle {
        left,
        top,
        width: right - left + 1,
        height: bottom - top + 1,
    }
}

impl Rectangle {
    /// Rectangle that covers an image.
    fn whole([width, height]: [u32; 2]) -> Self {
        Self {
            left: 0,
            top: 0,
            width,
            height,
        }
    }

    /// Byte ranges of its rows in an image of the given width.
    fn rows(self, width: u32) -> impl Iterator<Item = std::ops::Range<usize>> {
        (self.top..self.top + self.height).map(move |y| {
            let start = 4 * (y as usize * width as usize + self.left as usize);
            start..start + 4 * self.width as usize
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_animation_with_a_lost_frame_is_not_renamed() {
        for ending in ["gif", "png"] {
            let name = format!("incise-broken-{}.{ending}", std::process::id());
            let path = std::env::temp_dir().join(name);
            let picture = Image::filled(3, 2, [1, 2, 3]);
            let mut film = Animation::create(&path, [3, 2], 0.1).unwrap();
            film.push(&picture).unwrap();
            // State after a failed push.
            film.writer = None;
            assert!(matches!(film.push(&picture), Err(RenderError::Io { .. })));
            let temporary = film.temporary.clone();
            assert!(matches!(film.finish(), Err(RenderError::Io { .. })));
            assert!(!path.exists() && !temporary.exists());
        }
    }

    /// Writing to a full disk fails.
    #[test]
    #[cfg(target_os = "linux")]
    fn a_frame_that_cannot_be_written_ends_the_animation() {
        let size = [200, 200];
        let name = format!("incise-full-{}.gif", std::process::id());
        let path = std::env::temp_dir().join(name);
        let mut picture = Image::filled(size[0], size[1], [0; 3]);
        // More than a buffer of 8 KiB holds, even compressed.
        let noise = (0..).map(|i: u32| i.wrapping_mul(2_654_435_761).to_be_bytes()[0]);
        for (byte, noise) in picture.rgba.iter_mut().zip(noise) {
            *byte = noise;
        }
        let mut film = Animation::create(&path, size, 0.1).unwrap();
        let full = File::options().write(true).open("/dev/full").unwrap();
        film.writer = Some(Writer::Gif(Box::new(Gif::new(full, size).unwrap())));
        assert!(matches!(film.push(&picture), Err(RenderError::Io { .. })));
        assert!(film.writer.is_none());
        film.pictures = 1;
        assert!(matches!(film.finish(), Err(RenderError::Io { .. })));
        assert!(!path.exists());
    }
}
