//! Senseless arguments and folders that cannot be written are handled as other bad input.

use crate::bad_input::{refused, refused_in_a_sentence, sandbox};
use crate::support::SCENE;

#[test]
fn places_that_cannot_be_written() {
    let sandbox = sandbox();
    let run = |rest: &[&'static str]| [&["run", "scene.toml", "--frames", "2"], rest].concat();
    // A path below a regular file exists for no user, not even for the administrator.
    for (rest, part) in [
        (&["--out", "tet.vtk/out"][..], "tet.vtk/out"),
        (&["--out", "tet.vtk"], "tet.vtk"),
        (&["--jsonl", "tet.vtk/frames.jsonl"], "tet.vtk/frames.jsonl"),
        (&["--jsonl", "none/frames.jsonl"], "none/frames.jsonl"),
        (&["--jsonl", "."], "cannot write ."),
        (&["--save-mesh", "tet.vtk/last.vtk"], "tet.vtk/last.vtk"),
        (&["--save-mesh", "none/last.vtu"], "none/last.vtu"),
        (&["--save-mesh", "last.xyz"], "last.xyz"),
        (&["--save-mesh", "last"], "last"),
        (&["--jsonl", "/"], "cannot write /"),
        (&["--animation", "none/animation.gif"], "none/animation.gif"),
        (
            &["--animation", "tet.vtk/animation.png"],
            "tet.vtk/animation.png",
        ),
        (
            &["--animation", "animation.mp4"],
            "animation.mp4: unknown ending; animations are written as .gif, .png, .apng",
        ),
        (&["--animation", "animation"], "unknown ending"),
        (
            &["--out", "a/b/c", "--animation", "none/animation.gif"],
            "none/animation.gif",
        ),
        (
            &["--no-pictures", "--animation", "animation.avi"],
            "animation.avi",
        ),
        (
            &["--out", "a/b/c", "--jsonl", "none/frames.jsonl"],
            "none/frames.jsonl",
        ),
    ] {
        refused_in_a_sentence(&sandbox, &run(rest), &[part]);
    }
    // An image of an animation cannot be shown for as long as a step of this scene takes.
    let slow = SCENE.replace("[world]", "[solver]\ntime_step = 20.0\n[world]");
    sandbox.write("slow.toml", slow);
    let animation = [
        "run",
        "slow.toml",
        "--frames",
        "2",
        "--animation",
        "animation.gif",
    ];
    refused_in_a_sentence(
        &sandbox,
        &animation,
        &["20 s for each image", "0.01 s to 10 s"],
    );
    for command in [
        &["color", "tet.vtk", "--csv", "tet.vtk/colors.csv"][..],
        &["color", "tet.vtk", "--csv", "none/colors.csv"],
        &["mesh", "convert", "tet.vtk", "none/tet.vtk"],
        &["mesh", "generate", "box", "--tets", "300", "none/box.vtk"],
    ] {
        refused_in_a_sentence(&sandbox, command, &["cannot write"]);
    }
    refused_in_a_sentence(
        &sandbox,
        &["mesh", "convert", "tet.vtk", "tet.xyz"],
        &["tet.xyz", ".vtu"],
    );
}

#[test]
fn names_and_numbers_that_do_not_exist() {
    let sandbox = sandbox();
    for (command, parts) in [
        (
            &["color", "tet.vtk", "--algorithm", "gredy"][..],
            &["gredy", "auto, scgc, jones-plassmann"][..],
        ),
        (
            &["color", "tet.vtk", "--algorithm", "vivace:0"],
            &["vivace:0", "whole number"],
        ),
        (
            &["color", "tet.vtk", "--algorithm", "greedy:best"],
            &["greedy:best", "smallest-last"],
        ),
        (
            &["color", "tet.vtk", "--clustering", "serial:0"],
            &["serial:0"],
        ),
        (
            &["color", "tet.vtk", "--clustering", "serial:x"],
            &["serial:x"],
        ),
        (&["color", "tet.vtk", "--clustering", "blocks"], &["blocks"]),
        (
            &["mesh", "generate", "cube", "--tets", "300", "a.vtk"],
            &["cube", "box"],
        ),
        (
            &["mesh", "generate", "box", "--tets", "0", "a.vtk"],
            &["0 tets"],
        ),
        (
            &["mesh", "generate", "box", "--tets", "99999999999", "a.vtk"],
            &["99999999999 tets"],
        ),
        (
            &["mesh", "generate", "box", "--tets", "300", "a.xyz"],
            &["a.xyz"],
        ),
    ] {
        refused_in_a_sentence(&sandbox, command, parts);
    }
}

/// Here the message has the form of the argument parser.
#[test]
fn arguments_that_do_not_exist() {
    let sandbox = sandbox();
    for (command, parts) in [
        (
            &["run", "scene.toml", "--frmes", "3"][..],
            &["--frmes", "'--frames'"][..],
        ),
        (
            &["color", "tet.vtk", "--algoritm", "scgc"],
            &["--algoritm", "'--algorithm'"],
        ),
        (
            &["mesh", "generate", "box", "--tet", "300", "a.vtk"],
            &["--tet", "'--tets'"],
        ),
        (&["colr", "tet.vtk"], &["'colr'", "'color'"]),
        (&["run", "scene.toml", "--frames", "0"], &["--frames"]),
        (&["run", "scene.toml", "--frames", "-1"], &["-1"]),
        (&["run", "scene.toml", "--frames", "many"], &["many"]),
        (&["run", "scene.toml", "--threads", "0"], &["--threads"]),
        (
            &["run", "scene.toml", "--precision", "f16"],
            &["f16", "f32"],
        ),
        (
            &["run", "scene.toml", "--backend", "cpuu"],
            &["cpuu", "'cpu'"],
        ),
        (
            &["mesh", "generate", "box", "--tets", "-3", "a.vtk"],
            &["-3"],
        ),
        (&["mesh", "generate", "box", "a.vtk"], &["--tets"]),
        (&["run", "scene.toml", "--jsonl", ""], &["--jsonl"]),
        (
            &["run", "scene.toml", "--size", "0x480"],
            &["--size", "from 1 to 8192"],
        ),
        (
            &["run", "scene.toml", "--size", "9000x480"],
            &["--size", "from 1 to 8192"],
        ),
        (
            &["run", "scene.toml", "--size", "640"],
            &["--size", "960x720"],
        ),
        (
            &["run", "scene.toml", "--view", "1"],
            &["--view", "-60,22,1.5"],
        ),
        (
            &["run", "scene.toml", "--view", "0,91"],
            &["--view", "from -90 to 90"],
        ),
        (
            &["run", "scene.toml", "--view", "0,0,0"],
            &["--view", "zoom from 0.001"],
        ),
        (&["run", "scene.toml", "--view", "nan,0"], &["--view"]),
        (
            &["run", "scene.toml", "--color-by", "blue"],
            &["blue", "tissue, color, cluster"],
        ),
        (&["color"], &["INPUT"]),
        (&["mesh"], &["info"]),
    ] {
        refused(&sandbox, command, parts);
    }
}

#[test]
fn an_option_of_a_run_without_its_command() {
    let sandbox = sandbox();
    refused(&sandbox, &["--out", "a"], &["incise run --out"]);
    refused(&sandbox, &["--frames=3"], &["incise run --frames=3"]);
    for other in [&["--oot", "a"][..], &["mesh", "--out", "a"]] {
        assert!(!refused(&sandbox, other, &[]).contains("incise run"));
    }
}
