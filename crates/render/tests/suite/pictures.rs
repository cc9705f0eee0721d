//! Pictures: sizes, threads, cameras at unusual positions, and two pieces that are separate in the picture.

use glam::DVec3;
use incise_render::{Camera, ColorBy, Image, RenderError, Style, software_picture};

use crate::support::{LIVER, Shown, TWO_BODIES};

fn draw(shown: &Shown, camera: &Camera, style: &Style, size: [u32; 2]) -> Image {
    let positions = shown.simulation.positions();
    software_picture(&shown.render_scene, positions, camera, style, size).unwrap()
}

/// Numbers of pixels of what is red, by connected regions, the largest first; below ten pixels nothing counts.
fn regions(picture: &Image) -> Vec<usize> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let red = |i: usize| i32::from(picture.rgba[4 * i]) - i32::from(picture.rgba[4 * i + 2]) > 25;
    let mut open: Vec<bool> = (0..width * height).map(red).collect();
    let mut found = Vec::new();
    for start in 0..open.len() {
        let (mut stack, mut count) = (vec![start], 0);
        while let Some(i) = stack.pop() {
            if !std::mem::take(&mut open[i]) {
                continue;
            }
            count += 1;
            let (x, y) = (i % width, i / width);
            stack.extend((x > 0).then(|| i - 1));
            stack.extend((x + 1 < width).then(|| i + 1));
            stack.extend((y > 0).then(|| i - width));
            stack.extend((y + 1 < height).then(|| i + width));
        }
        if count >= 10 {
            found.push(count);
        }
    }
    found.sort_unstable_by(|a, b| b.cmp(a));
    found
}

#[test]
fn two_pieces_are_two_regions() {
    let mut shown = Shown::new(LIVER, 1);
    let mut camera = shown.camera();
    // Along the cut.
    camera.azimuth = -1.6;
    camera.elevation = 0.05;
    let before = regions(&draw(&shown, &camera, &Style::default(), [160, 120]));
    assert_eq!(before.len(), 1, "{before:?}");
    shown.advance(17);
    assert_eq!(shown.simulation.report().pieces, 2);
    let after = regions(&draw(&shown, &camera, &Style::default(), [160, 120]));
    assert_eq!(after.len(), 2, "{after:?}");
    // Nothing is lost: what was hidden before makes up for what the fall hides.
    let (sum, whole) = (after.iter().sum::<usize>(), before[0]);
    assert!(
        sum * 10 > whole * 8 && sum * 10 < whole * 14,
        "{before:?} {after:?}"
    );
}

#[test]
fn sizes_that_are_no_pictures_are_refused() {
    let shown = Shown::new(LIVER, 0);
    let camera = shown.camera();
    for size in [[0, 1], [1, 0], [0, 0], [8193, 1], [1, u32::MAX]] {
        let picture = software_picture(
            &shown.render_scene,
            shown.simulation.positions(),
            &camera,
            &Style::default(),
            size,
        );
        let error = picture.unwrap_err();
        assert!(matches!(error, RenderError::Size { .. }), "{error}");
        assert!(error.to_string().contains("from 1 to 8192"), "{error}");
    }
    for size in [[1, 1], [1, 40], [33, 17], [8192, 1]] {
        let picture = draw(&shown, &camera, &Style::default(), size);
        assert_eq!(picture.rgba.len(), 4 * size[0] as usize * size[1] as usize);
        assert!(picture.rgba.chunks_exact(4).all(|pixel| pixel[3] == 255));
    }
}

#[test]
fn threads_change_nothing() {
    let shown = Shown::new(TWO_BODIES, 2);
    let camera = shown.camera();
    let style = Style {
        wireframe: true,
        ..Style::default()
    };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| draw(&shown, &camera, &style, [120, 90]))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn cameras_may_be_anywhere() {
    let shown = Shown::new(TWO_BODIES, 1);
    let usual = shown.camera();
    let mut blank = 0;
    for (i, eye) in [
        // In a body, on its surface, in an obstacle, under the floor, on the floor, far away.
        DVec3::new(0.0, -0.3, 0.0),
        shown.simulation.positions()[0],
        DVec3::new(0.45, 0.0, -0.2),
        DVec3::new(0.0, 0.0, -2.0),
        DVec3::new(0.3, 0.0, -0.3),
        DVec3::new(1e6, 1e6, 1e6),
    ]
    .into_iter()
    .enumerate()
    {
        for (azimuth, elevation) in [(0.0, 0.0), (2.0, 1.5), (-1.0, -1.5)] {
            for distance in [1e-6, 0.1, 1.0] {
                let mut camera = Camera {
                    azimuth,
                    elevation,
                    distance,
                    ..usual
                };
                camera.target += eye - camera.eye();
                assert!((camera.eye() - eye).length() <= 1e-9 * eye.length().max(1.0));
                let picture = draw(&shown, &camera, &Style::default(), [32, 24]);
                let first = picture.pixel(0, 0);
                let same = |i: u32| picture.pixel(i % 32, i / 32) == first;
                blank += usize::from((0..32 * 24).all(same));
                // Inside of the ball everything is its inside: darker than tissue is outside, and red.
                if i == 0 && distance < 0.2 {
                    let [r, g, b] = picture.pixel(16, 12);
                    assert!(r > g && r > b && g < 90, "{r} {g} {b}");
                }
            }
        }
    }
    // The background has a gradient; and a camera within a millimeter of something sees one color at most.
    assert!(blank < 12, "{blank} of 54");
}

#[test]
fn styles_show() {
    let mut shown = Shown::new(LIVER, 8);
    let camera = shown.camera();
    let plain = Style::default();
    let mut pictures = vec![draw(&shown, &camera, &plain, [80, 60])];
    for style in [
        Style {
            wireframe: true,
            ..plain
        },
        Style {
            smooth: false,
            ..plain
        },
    ] {
        pictures.push(draw(&shown, &camera, &style, [80, 60]));
    }
    for by in [
        ColorBy::Color,
        ColorBy::Cluster,
        ColorBy::Piece,
        ColorBy::Stretch,
    ] {
        shown
            .render_scene
            .color(&mut shown.simulation, by, None)
            .unwrap();
        let style = Style {
            color_by: by,
            ..plain
        };
        pictures.push(draw(&shown, &camera, &style, [80, 60]));
        // A style without available colors shows tissue.
        assert_eq!(draw(&shown, &camera, &plain, [80, 60]), pictures[0]);
    }
    let blade = [DVec3::new(0.0, -0.3, 0.0), DVec3::new(0.0, 0.3, 0.1)];
    shown.render_scene.set_blade(Some(&blade));
    pictures.push(draw(&shown, &camera, &plain, [80, 60]));
    for (i, a) in pictures.iter().enumerate() {
        assert!(pictures[..i].iter().all(|b| b != a), "{i}");
    }
    shown.render_scene.set_blade(Some(&blade[..1]));
    assert_eq!(draw(&shown, &camera, &plain, [80, 60]), pictures[0]);
    shown.render_scene.set_blade(None);
    assert_eq!(draw(&shown, &camera, &plain, [80, 60]), pictures[0]);
}

#[test]
fn places_far_from_the_origin_look_the_same() {
    let near = Shown::new(LIVER, 3);
    let far = LIVER.replace(
        "scale = 0.25",
        "scale = 0.25\nposition = [4096.0, -8192.0, 0.0]",
    );
    let far = far
        .replace(
            "point = [-0.03, 0.0, 0.0]",
            "point = [4095.97, -8192.0, 0.0]",
        )
        .replace(
            "point = [0.02, 0.0, 0.0]",
            "point = [4096.02, -8192.0, 0.0]",
        );
    let far = Shown::new(&far, 3);
    let mut camera = near.camera();
    let here = draw(&near, &camera, &Style::default(), [80, 60]);
    camera.target += DVec3::new(4096.0, -8192.0, 0.0);
    let there = draw(&far, &camera, &Style::default(), [80, 60]);
    let difference = crate::support::Difference::of(&here, &there, 8);
    // Rounding of doubles at 10 km is a billionth of the body: hardly a pixel changes sides.
    assert!(
        difference.mean < 0.1 && difference.share < 0.005,
        "{difference:?}"
    );
}

#[test]
fn pictures_shrink_and_survive_files() {
    let shown = Shown::new(LIVER, 0);
    let picture = draw(&shown, &shown.camera(), &Style::default(), [50, 31]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    picture.write_png(&path).unwrap();
    assert_eq!(Image::read_png(&path).unwrap(), picture);
    let small = picture.shrunk(4);
    assert_eq!((small.width, small.height), (12, 7));
    assert_eq!(picture.shrunk(0), picture);
    assert_eq!(picture.shrunk(32), picture);
    assert_eq!(
        Image::filled(9, 9, [10, 200, 90]).shrunk(3),
        Image::filled(3, 3, [10, 200, 90])
    );
    let missing = Image::read_png(folder.path().join("none.png")).unwrap_err();
    assert!(missing.to_string().contains("none.png"), "{missing}");
    std::fs::write(&path, b"no picture").unwrap();
    assert!(matches!(
        Image::read_png(&path),
        Err(RenderError::Io { .. })
    ));
    assert!(picture.write_png(folder.path().join("none/a.png")).is_err());
}

/// A box on its own that is cut in frame 1 and stays closed, seen from above.
#[test]
fn a_closed_cut_shows_as_a_line() {
    let picture = |frames: usize| {
        let mut shown = Shown::new(
            r#"
            [[body]]
            shape = { kind = "box", tets = 600 }
            [[stroke]]
            kind = "plane"
            frame = 1
            point = [0.03, 0.0, 0.0]
            normal = [1.0, 0.0, 0.0]
            "#,
            1,
        );
        let mut camera = shown.camera();
        // Image columns go along x.
        (camera.azimuth, camera.elevation) = (-std::f64::consts::FRAC_PI_2, 1.5);
        shown.advance(frames);
        let pieces = shown.simulation.report().pieces;
        let picture = draw(&shown, &camera, &Style::default(), [160, 120]);
        let light = |x: u32| {
            let [r, g, b] = picture.pixel(x, 60).map(u32::from);
            r + g + b
        };
        (pieces, (0..160).map(light).collect::<Vec<_>>())
    };
    let ((before, whole), (after, cut)) = (picture(0), picture(1));
    assert_eq!((before, after), (1, 2));
    let dark = |x: &usize| 4 * cut[*x] < 3 * whole[*x];
    let columns: Vec<usize> = (0..160).filter(dark).collect();
    // In the middle, a little to the right, and as wide as a line.
    assert!(
        (1..=3).contains(&columns.len()) && columns.iter().all(|x| (80..95).contains(x)),
        "{columns:?}"
    );
}
