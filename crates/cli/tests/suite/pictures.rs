//! Pictures, contact sheet and animations of a run, with the requested sizes and frames.

use std::fs;

use crate::bad_input::refused_in_a_sentence;
use crate::support::Sandbox;

/// A run of the small scene with these arguments more; what it printed.
fn run(sandbox: &Sandbox, rest: &[&str]) -> String {
    sandbox.good(&[&["run", "scene.toml"], rest].concat())
}

/// Width and height as a PNG file says.
fn size(sandbox: &Sandbox, name: &str) -> [u32; 2] {
    let bytes = fs::read(sandbox.path(name)).unwrap();
    assert!(bytes.starts_with(b"\x89PNG\r\n\x1a\n"), "{name}");
    assert!(bytes.ends_with(b"IEND\xae\x42\x60\x82"), "{name} is whole");
    [16, 20].map(|at| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()))
}

fn pngs(sandbox: &Sandbox, folder: &str) -> Vec<String> {
    let names = sandbox.names(folder).into_iter();
    names.filter(|name| name.ends_with(".png")).collect()
}

#[test]
fn a_run_is_seen() {
    let sandbox = Sandbox::with_scene();
    let said = run(&sandbox, &["--frames", "4"]);
    assert!(
        said.contains("4 pictures and contact_sheet.png are in out, drawn by "),
        "{said}"
    );
    let frames = [0, 1, 2, 3].map(|frame| format!("frame_{frame:05}.png"));
    let mut expected = vec!["contact_sheet.png"];
    expected.extend(frames.iter().map(String::as_str));
    assert_eq!(pngs(&sandbox, "out"), expected);
    for frame in &frames {
        assert_eq!(size(&sandbox, &format!("out/{frame}")), [640, 480]);
    }
    // Four columns of half the size with margins of 10, and a row with captions of 20.
    assert_eq!(
        size(&sandbox, "out/contact_sheet.png"),
        [10 + 4 * 330, 10 + 270]
    );
    let read = |frame: &String| fs::read(sandbox.path("out").join(frame)).unwrap();
    assert_ne!(read(&frames[0]), read(&frames[3]), "it falls");
}

/// A body that falls out of a view that was asked for is named, and the view of the message shows it.
#[test]
fn a_body_that_leaves_the_picture_is_named() {
    let sandbox = Sandbox::with_scene();
    let frames = ["--frames", "40", "--size", "48x32"];
    let said = run(&sandbox, &[&frames[..], &["--view=-60,22,1"]].concat());
    let note = said
        .lines()
        .find(|line| line.starts_with("bodies leave the picture at frame "));
    let note = note.unwrap_or_else(|| panic!("{said}"));
    let view = note
        .split_whitespace()
        .find(|word| word.starts_with("--view="));
    let view = view.unwrap_or_else(|| panic!("{note}"));
    let said = run(&sandbox, &[&frames[..], &[view]].concat());
    assert!(!said.contains("leave the picture"), "{said}");
}

/// Without a view the camera steps back when a body moves away, and returns to the start when it is too far.
#[test]
fn the_camera_steps_back() {
    let sandbox = Sandbox::new();
    let frames = ["--frames", "30", "--size", "48x32"];
    let first_and_last = |options: &[&str], speed: f64| {
        let body = "[[body]]\nshape = { kind = \"box\", tets = 200 }\nscale = 0.3\n";
        sandbox.write(
            "scene.toml",
            format!("{body}velocity = [{speed:?}, 0.0, 0.0]\n"),
        );
        let said = run(&sandbox, &[&frames[..], options].concat());
        let has_left = said.contains("leave the picture");
        let read = |frame: u32| {
            fs::read(sandbox.path("out").join(format!("frame_{frame:05}.png"))).unwrap()
        };
        (has_left, [read(0), read(29)])
    };
    for (speed, is_followed) in [(1.5, true), (30.0, false)] {
        let (has_left, [first, last]) = first_and_last(&[], speed);
        assert_eq!(has_left, !is_followed);
        let (has_left, fixed) = first_and_last(&["--view=-60,22,1"], speed);
        assert!(has_left);
        assert_eq!(
            fixed[0] == first,
            is_followed,
            "fast bodies are far in the first picture"
        );
        assert_eq!(fixed[1] == last, !is_followed);
    }
}

#[test]
fn about_fifty_frames_are_seen() {
    let sandbox = Sandbox::with_scene();
    run(&sandbox, &["--frames", "120", "--size", "24x16", "--quiet"]);
    let surfaces = sandbox.names("out").into_iter();
    let surfaces = surfaces.filter(|name| name.ends_with(".vtp")).count();
    // One more is the sheet.
    assert_eq!(pngs(&sandbox, "out").len(), surfaces + 1);
    assert!((40..=51).contains(&surfaces), "{surfaces}");
    // Twelve in three rows.
    assert_eq!(
        size(&sandbox, "out/contact_sheet.png"),
        [10 + 4 * 34, 10 + 3 * 46]
    );
}

#[test]
fn unrequested_files_are_not_written() {
    let sandbox = Sandbox::with_scene();
    let said = run(&sandbox, &["--frames", "2", "--no-pictures"]);
    assert!(!said.contains("drawn"), "{said}");
    assert!(pngs(&sandbox, "out").is_empty());
}

#[test]
fn animations_are_written_in_both_formats() {
    let sandbox = Sandbox::with_scene();
    // A step of 16 ms: every other frame.
    let arguments = ["--frames", "12", "--size", "48x40"];
    let animation = |rest: &[&str]| run(&sandbox, &[&arguments, rest].concat());
    let said = animation(&["--animation", "run.gif", "--out", "a"]);
    assert!(said.contains("animation: run.gif"), "{said}");
    let gif = fs::read(sandbox.path("run.gif")).unwrap();
    assert!(
        gif.starts_with(b"GIF89a") && gif.ends_with(&[0x3b]),
        "whole"
    );
    assert_eq!([gif[6], gif[8]], [48, 40]);
    // Graphic control extensions: one a picture, with a delay of 3 hundredths, rounded.
    let controls = gif
        .windows(3)
        .filter(|bytes| *bytes == [0x21, 0xf9, 4])
        .count();
    assert_eq!(controls, 6);
    assert_eq!(pngs(&sandbox, "a").len(), 13);

    let said = animation(&["--animation", "b/run.png", "--no-pictures", "--out", "b"]);
    assert!(said.contains("animation: b/run.png, drawn by"), "{said}");
    assert_eq!(pngs(&sandbox, "b"), ["run.png"]);
    assert_eq!(size(&sandbox, "b/run.png"), [48, 40]);
    let png = fs::read(sandbox.path("b/run.png")).unwrap();
    let at = png.windows(4).position(|name| name == b"acTL").unwrap();
    assert_eq!(png[at + 4..at + 8], [0, 0, 0, 6]);
    assert!(
        sandbox
            .names(".")
            .iter()
            .all(|name| !name.contains("partial"))
    );
}

#[test]
fn view_options_are_applied() {
    let sandbox = Sandbox::with_scene();
    let mut pictures = Vec::new();
    for (i, rest) in [
        &[][..],
        &["--view", "30,40"],
        &["--view=-60,22,2"],
        &["--color-by", "color"],
        &["--color-by", "stretch", "--wireframe"],
        &["--wireframe"],
        &["--color-by", "residual"],
    ]
    .into_iter()
    .enumerate()
    {
        let folder = i.to_string();
        let usual = [
            "--frames", "2", "--size", "60x40", "--quiet", "--out", &folder,
        ];
        run(&sandbox, &[&usual, rest].concat());
        let name = format!("{folder}/frame_00001.png");
        assert_eq!(size(&sandbox, &name), [60, 40]);
        pictures.push(fs::read(sandbox.path(&name)).unwrap());
    }
    for (i, picture) in pictures.iter().enumerate() {
        assert!(!pictures[..i].contains(picture), "{i}");
    }
    // The default view.
    let usual = [
        "--frames", "2", "--size", "60x40", "--quiet", "--out", "again",
    ];
    run(&sandbox, &[&usual[..], &["--view", "-60,22"]].concat());
    assert!(fs::read(sandbox.path("again/frame_00001.png")).unwrap() == pictures[0]);
}

#[test]
fn residuals_are_shown_where_there_are_some() {
    let sandbox = Sandbox::with_scene();
    let usual = [
        "--frames",
        "2",
        "--size",
        "30x20",
        "--quiet",
        "--color-by",
        "residual",
    ];
    run(&sandbox, &usual);
    let lines = sandbox.read("out/frames.jsonl");
    assert_eq!(lines.matches("\"residual\":").count(), 2, "{lines}");
    let scene = crate::support::SCENE.replace("[world]", "[solver]\nmethod = \"vbd\"\n[world]");
    sandbox.write("vbd.toml", scene);
    let command = [&["run", "vbd.toml"], &usual[..]].concat();
    refused_in_a_sentence(&sandbox, &command, &["--color-by residual", "vbd"]);
    // Where nothing is drawn, residuals are not needed.
    let nothing = [&command[..], &["--no-pictures"]].concat();
    sandbox.good(&nothing);
    run(&sandbox, &[&usual[..], &["--no-pictures"]].concat());
    let lines = sandbox.read("out/frames.jsonl");
    assert!(!lines.contains("\"residual\":"), "{lines}");
    let animation = [&nothing[..], &["--animation", "animation.gif"]].concat();
    refused_in_a_sentence(&sandbox, &animation, &["--color-by residual", "vbd"]);
}

#[test]
fn pictures_of_an_earlier_run_are_not_left_among_those_of_this_one() {
    let sandbox = Sandbox::with_scene();
    let usual = ["--size", "30x20", "--quiet", "--frames"];
    run(&sandbox, &[&usual[..], &["4"]].concat());
    for name in ["frame_1.png", "frame_0000x.png", "my_frame_00001.png"] {
        sandbox.write(&format!("out/{name}"), "of a user");
    }
    // A run that ends with an error removes nothing.
    let refused = [
        &["run", "scene.toml", "--animation", "none/animation.gif"],
        &usual[..],
    ]
    .concat();
    refused_in_a_sentence(
        &sandbox,
        &[&refused[..], &["2"]].concat(),
        &["none/animation.gif"],
    );
    assert_eq!(pngs(&sandbox, "out").len(), 4 + 1 + 3);
    run(&sandbox, &[&usual[..], &["2"]].concat());
    let mut expected = vec!["contact_sheet.png", "frame_00000.png", "frame_00001.png"];
    expected.extend(["frame_0000x.png", "frame_1.png", "my_frame_00001.png"]);
    assert_eq!(pngs(&sandbox, "out"), expected);
    run(&sandbox, &[&usual[..], &["2", "--no-pictures"]].concat());
    assert_eq!(pngs(&sandbox, "out"), expected[3..]);
}

/// Delays of the images of an animated PNG in seconds, and their number.
fn delays(sandbox: &Sandbox, name: &str) -> Vec<f64> {
    let bytes = fs::read(sandbox.path(name)).unwrap();
    let chunks = bytes
        .windows(4)
        .enumerate()
        .filter(|(_, word)| word == b"fcTL");
    let number = |at: usize| f64::from(u16::from_be_bytes([bytes[at], bytes[at + 1]]));
    chunks
        .map(|(at, _)| number(at + 24) / number(at + 26))
        .collect()
}

/// A second of simulated time has as many images as asked for and lasts a second.
#[test]
fn animations_have_the_wanted_rate() {
    let sandbox = Sandbox::with_scene();
    // 63 frames of 16 ms.
    for (rate, images) in [("10", 10), ("30", 30), ("62.5", 63)] {
        let name = format!("at{rate}.png");
        let arguments = [
            "--frames",
            "63",
            "--size",
            "24x16",
            "--no-pictures",
            "--quiet",
        ];
        run(
            &sandbox,
            &[&arguments[..], &["--animation", &name, "--fps", rate]].concat(),
        );
        let delays = delays(&sandbox, &name);
        assert_eq!(delays.len(), images, "{rate}");
        let seconds: f64 = delays.iter().sum();
        assert!(
            (seconds - images as f64 / rate.parse::<f64>().unwrap()).abs() < 2e-3,
            "{rate}: {seconds}"
        );
    }
    let more = ["run", "scene.toml", "--animation", "a.gif", "--fps", "70"];
    refused_in_a_sentence(&sandbox, &more, &["--fps 70", "62.5 frames per second"]);
    let alone = sandbox.incise(&["run", "scene.toml", "--fps", "30"]);
    assert!(alone.stderr.contains("--animation"), "{alone:?}");
}
