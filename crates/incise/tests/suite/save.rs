//! A snapshot that one process writes, another one reads and continues, to the bit.

use std::env;
use std::fs;
use std::path::Path;
use std::process::Command;

use incise::{Simulation, Snapshot};

use crate::snapshot::everything;
use crate::support::{body, scene, simulation, sweep};

/// Names the folder through which the processes talk.
const FOLDER: &str = "INCISE_TEST_SAVE";

/// Frames after the snapshot; the blade is in the body.
const FRAMES: u32 = 6;

/// What is to be seen after the frames that follow a snapshot.
fn continued(mut simulation: Simulation) -> Vec<u8> {
    let mut words = Vec::new();
    for _ in 0..FRAMES {
        simulation.step().unwrap();
        words.extend(everything(&mut simulation));
    }
    words.into_iter().flat_map(u64::to_le_bytes).collect()
}

/// The other process: this test alone, told where the snapshot is. On its own it has nothing to do.
#[test]
fn another_process() {
    let Some(folder) = env::var_os(FOLDER) else {
        return;
    };
    let folder = Path::new(&folder);
    let bytes = fs::read(folder.join("snapshot")).unwrap();
    let snapshot: Snapshot = postcard::from_bytes(&bytes).unwrap();
    let words = continued(Simulation::from_snapshot(&snapshot).unwrap());
    fs::write(folder.join("continued"), words).unwrap();
}

#[test]
fn another_process_continues_a_file() {
    for solver in [
        "precision = \"f32\"",
        "method = \"vbd\"\ntwo_level = true\nsubsteps = 1\naccuracy = 0.05\nprecision = \"f64\"",
    ] {
        let blade = sweep(
            [1, 8],
            [[0.05, -1.0, 0.6], [0.1, 1.0, 0.6]],
            [0.0, 0.0, -1.2],
        );
        let text = format!(
            "[world]\ngravity = [0.0, 0.0, -9.81]\nground = {{ height = -0.5, friction = 0.4 }}\n\
             [report]\nquantities = [\"energy\"]\n[solver]\n{solver}\n{}{blade}",
            body("beam", 400, [0.0; 3])
        );
        let mut simulation = simulation(&scene(&text));
        while simulation.step().unwrap().cut.is_none() {}
        let folder = tempfile::tempdir().unwrap();
        let snapshot = simulation.snapshot().unwrap();
        let bytes = postcard::to_stdvec(&snapshot).unwrap();
        fs::write(folder.path().join("snapshot"), bytes).unwrap();
        let other = Command::new(env::current_exe().unwrap())
            .args(["--exact", "save::another_process"])
            .env(FOLDER, folder.path())
            .output()
            .unwrap();
        assert!(other.status.success(), "{other:?}");
        let read = fs::read(folder.path().join("continued")).unwrap();
        assert!(read == continued(simulation), "{solver}");
    }
}

/// What another version wrote is refused in words, and so is half a file.
#[test]
fn other_versions_and_damaged_files_are_refused() {
    let mut simulation = simulation(&scene(&body("sphere", 200, [0.0; 3])));
    let bytes = postcard::to_stdvec(&simulation.snapshot().unwrap()).unwrap();
    let name = format!("incise {}", env!("CARGO_PKG_VERSION"));
    assert_eq!(&bytes[1..=name.len()], name.as_bytes());
    let mut other = bytes.clone();
    other[name.len()] = b'x';
    assert!(postcard::from_bytes::<Snapshot>(&other).is_err());
    assert!(postcard::from_bytes::<Snapshot>(&bytes[..bytes.len() / 2]).is_err());
}
