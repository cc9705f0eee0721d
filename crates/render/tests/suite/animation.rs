//! Animations decoded by other libraries are the pictures that were encoded.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;

use incise_render::{Animation, Image, RenderError};

/// A square that wanders over a gradient, with a still picture between; many more than 256 colors.
fn pictures() -> Vec<Image> {
    let byte = |value: u32| u8::try_from(value % 256).unwrap();
    let picture = |step: u32| {
        let mut picture = Image::filled(40, 30, [0; 3]);
        for (x, y) in (0..40_u32).flat_map(|x| (0..30_u32).map(move |y| (x, y))) {
            let inside = x.wrapping_sub(3 * step) < 8 && y.wrapping_sub(2 * step) < 8;
            let color = if inside {
                [byte(200 + x), byte(30 + 5 * y), 20]
            } else {
                [byte(100 + x), byte(110 + 2 * y), byte(120 + x + y)]
            };
            let at = 4 * (40 * y + x) as usize;
            picture.rgba[at..at + 3].copy_from_slice(&color);
        }
        picture
    };
    [0, 1, 1, 2, 6].map(picture).to_vec()
}

fn write(path: &Path, seconds: f64) {
    let mut film = Animation::create(path, [40, 30], seconds).unwrap();
    pictures()
        .iter()
        .for_each(|picture| film.push(picture).unwrap());
    film.finish().unwrap();
}

/// The pictures of an animated PNG, put together as viewers do, and their delays in s.
fn decode_png(path: &Path) -> (Vec<Image>, Vec<f64>) {
    let decoder = png::Decoder::new(BufReader::new(File::open(path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let control = *reader.info().animation_control().unwrap();
    assert_eq!(control.num_plays, 0, "forever");
    let (mut pictures, mut delays) = (Vec::new(), Vec::new());
    let mut canvas = Image::filled(40, 30, [0; 3]);
    for _ in 0..control.num_frames {
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        let frame = *reader.info().frame_control().unwrap();
        delays.push(f64::from(frame.delay_num) / f64::from(frame.delay_den));
        for (row, pixels) in bytes
            .chunks_exact(info.line_size)
            .take(frame.height as usize)
            .enumerate()
        {
            for (column, pixel) in pixels
                .chunks_exact(3)
                .take(frame.width as usize)
                .enumerate()
            {
                let (x, y) = (
                    frame.x_offset as usize + column,
                    frame.y_offset as usize + row,
                );
                let at = 4 * (40 * y + x);
                canvas.rgba[at..at + 3].copy_from_slice(pixel);
            }
        }
        pictures.push(canvas.clone());
    }
    (pictures, delays)
}

fn decode_gif(path: &Path) -> (Vec<Image>, Vec<f64>) {
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut reader = options.read_info(File::open(path).unwrap()).unwrap();
    assert_eq!((reader.width(), reader.height()), (40, 30));
    let (mut pictures, mut delays) = (Vec::new(), Vec::new());
    let mut canvas = Image::filled(40, 30, [0; 3]);
    while let Some(frame) = reader.read_next_frame().unwrap() {
        delays.push(f64::from(frame.delay) / 100.0);
        let pixels = frame.buffer.chunks_exact(4).enumerate();
        for (i, pixel) in pixels.filter(|(_, pixel)| pixel[3] > 0) {
            let (column, row) = (i % usize::from(frame.width), i / usize::from(frame.width));
            let (x, y) = (
                usize::from(frame.left) + column,
                usize::from(frame.top) + row,
            );
            let at = 4 * (40 * y + x);
            canvas.rgba[at..at + 4].copy_from_slice(pixel);
        }
        pictures.push(canvas.clone());
    }
    assert_eq!(reader.repeat(), gif::Repeat::Infinite);
    (pictures, delays)
}

#[test]
fn an_animated_png_keeps_every_pixel() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["film.png", "film.APNG"] {
        let path = folder.path().join(name);
        write(&path, 0.04);
        let (decoded, delays) = decode_png(&path);
        assert_eq!(decoded, pictures());
        assert_eq!(delays, [0.04; 5]);
        // For viewers that know no animation it is the first picture.
        assert_eq!(Image::read_png(&path).unwrap(), pictures()[0]);
    }
}

#[test]
fn a_gif_keeps_as_many_colors_as_fit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.gif");
    write(&path, 0.025);
    let (decoded, delays) = decode_gif(&path);
    assert_eq!(decoded.len(), 5);
    // Hundredths of a second, rounded so that they add up.
    assert!(
        (delays.iter().sum::<f64>() - 0.125).abs() < 0.0051,
        "{delays:?}"
    );
    assert!(delays.iter().all(|delay| (0.02..=0.03).contains(delay)));
    for (decoded, picture) in decoded.iter().zip(pictures()) {
        for (a, b) in decoded.rgba.iter().zip(&picture.rgba) {
            // 1200 colors become 255: neighbors in three channels that change by some 40 to 60 levels, of which each
            // palette entry holds five; and what differs by up to 2 is not stored again.
            assert!(a.abs_diff(*b) <= 12, "{a} {b}");
        }
    }
}

#[test]
fn animations_with_few_changes_are_small() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["still.gif", "still.png"] {
        let path = folder.path().join(name);
        let size = |count: usize| {
            let mut film = Animation::create(&path, [40, 30], 0.1).unwrap();
            (0..count).for_each(|_| film.push(&pictures()[0]).unwrap());
            film.finish().unwrap();
            fs::metadata(&path).unwrap().len()
        };
        // A palette of a GIF has 768 bytes; a pixel and the frames of a format hardly any.
        let (one, many) = (size(1), size(11));
        assert!(many - one < 10 * 850, "{name}: {one} {many}");
    }
}

#[test]
fn invalid_animations_are_refused_without_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for name in ["film.mp4", "film", "film.gif.txt"] {
        let error = Animation::create(path(name), [4, 4], 0.1).unwrap_err();
        assert!(error.to_string().contains(".gif, .png, .apng"), "{error}");
        assert!(Animation::check_path(path(name)).is_err());
    }
    assert!(Animation::check_path("a.gif").is_ok());
    for size in [[0, 4], [4, 0], [65_536, 4]] {
        let error = Animation::create(path("a.gif"), size, 0.1).unwrap_err();
        assert!(matches!(error, RenderError::Size { .. }), "{error}");
    }
    for seconds in [0.0, -1.0, 11.0, f64::NAN] {
        let error = Animation::create(path("a.gif"), [4, 4], seconds).unwrap_err();
        assert!(matches!(error, RenderError::FrameTime { .. }), "{error}");
    }
    assert!(matches!(
        Animation::create(path("none/a.gif"), [4, 4], 0.1),
        Err(RenderError::Io { .. })
    ));
    fs::create_dir(path("folder.gif")).unwrap();
    assert!(matches!(
        Animation::create(path("folder.gif"), [4, 4], 0.1),
        Err(RenderError::Io { .. })
    ));
    fs::remove_dir(path("folder.gif")).unwrap();

    for name in ["a.gif", "a.png"] {
        let mut film = Animation::create(path(name), [40, 30], 0.1).unwrap();
        film.push(&pictures()[0]).unwrap();
        let other = film.push(&Image::filled(30, 40, [0; 3])).unwrap_err();
        assert!(matches!(other, RenderError::OtherSize { .. }), "{other}");
        drop(film);
        let empty = Animation::create(path(name), [40, 30], 0.1).unwrap();
        assert!(matches!(empty.finish(), Err(RenderError::EmptyFilm { .. })));
    }
    assert_eq!(
        fs::read_dir(folder.path()).unwrap().count(),
        0,
        "nothing is left"
    );
}

#[test]
fn a_finished_animation_replaces_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.png");
    fs::write(&path, b"before").unwrap();
    let mut film = Animation::create(&path, [40, 30], 0.1).unwrap();
    film.push(&pictures()[0]).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"before");
    film.finish().unwrap();
    assert_eq!(Image::read_png(&path).unwrap(), pictures()[0]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}
