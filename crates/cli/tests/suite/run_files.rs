//! The files of `incise run`: the same for any number of threads, whole under their names, usable afterwards.

use std::collections::BTreeSet;
use std::fs;

use incise::mesh::TetMesh;
use incise::mesh::glam::DVec3;
use incise::mesh_io::{NamedValues, OwnedValues};
use incise::{Scene, Simulation};

use crate::support::{SCENE, Sandbox};

/// All but the times: those are of no two runs the same.
fn same_files(sandbox: &Sandbox, a: &str, b: &str) {
    assert_eq!(sandbox.names(a), sandbox.names(b));
    for name in sandbox
        .names(a)
        .iter()
        .filter(|name| *name != "frames.jsonl")
    {
        let [a, b] = [a, b].map(|folder| fs::read(sandbox.path(folder).join(name)).unwrap());
        assert!(a == b, "{name} differs");
    }
}

#[test]
fn any_number_of_threads_writes_the_same_bytes() {
    let sandbox = Sandbox::new();
    // Large enough that threads share the work of a color; pictures are drawn by the same threads, in bands of 16 rows.
    let scene = SCENE
        .replace("tets = 300", "tets = 9000")
        .replace("[world]", "[solver]\nclustering = \"serial:20\"\n[world]");
    sandbox.write("scene.toml", scene);
    for threads in ["1", "3"] {
        sandbox.good(&[
            "run",
            "scene.toml",
            "--frames",
            "3",
            "--quiet",
            "--size",
            "160x120",
            "--threads",
            threads,
            "--out",
            threads,
        ]);
    }
    same_files(&sandbox, "1", "3");
    let drawn = |name: &String| name.ends_with(".png");
    assert_eq!(sandbox.names("1").into_iter().filter(drawn).count(), 4);
}

#[test]
fn precision_is_as_asked_for() {
    let sandbox = Sandbox::with_scene();
    for precision in ["f32", "f64"] {
        sandbox.good(&[
            "run",
            "scene.toml",
            "--frames",
            "2",
            "--quiet",
            "--no-pictures",
            "--precision",
            precision,
            "--out",
            precision,
        ]);
        let lines = sandbox.read(&format!("{precision}/frames.jsonl"));
        assert_eq!(
            lines
                .matches(&format!("\"precision\":\"{precision}\""))
                .count(),
            2
        );
        assert!(
            sandbox
                .read(&format!("{precision}/scene.toml"))
                .contains(&format!("precision = \"{precision}\""))
        );
    }
    assert!(sandbox.read("f32/mesh.vtu") != sandbox.read("f64/mesh.vtu"));
}

#[test]
fn the_written_scene_runs_again_to_the_same_files() {
    let sandbox = Sandbox::new();
    fs::create_dir(sandbox.path("scenes")).unwrap();
    sandbox.good(&[
        "mesh",
        "generate",
        "sphere",
        "--tets",
        "400",
        "scenes/sphere.vtk",
    ]);
    sandbox.write(
        "scenes/scene.toml",
        SCENE.replace(
            "shape = { kind = \"box\", tets = 300 }",
            "mesh = \"sphere.vtk\"",
        ),
    );
    sandbox.good(&[
        "run",
        "scenes/scene.toml",
        "--frames",
        "3",
        "--quiet",
        "--size",
        "64x48",
        "--out",
        "deep/first",
    ]);
    sandbox.good(&[
        "run",
        "deep/first/scene.toml",
        "--frames",
        "3",
        "--quiet",
        "--size",
        "64x48",
        "--out",
        "second",
    ]);
    same_files(&sandbox, "deep/first", "second");
}

#[test]
fn a_mesh_from_the_command_line_replaces_that_of_the_scene() {
    let sandbox = Sandbox::with_scene();
    sandbox.good(&["mesh", "generate", "torus", "--tets", "700", "torus.node"]);
    sandbox.good(&[
        "run",
        "scene.toml",
        "--mesh",
        "torus.node",
        "--frames",
        "1",
        "--quiet",
    ]);
    let count = sandbox
        .read("torus.ele")
        .lines()
        .next()
        .unwrap()
        .split_whitespace()
        .next()
        .unwrap()
        .to_owned();
    assert!(
        sandbox
            .read("out/frames.jsonl")
            .contains(&format!("\"tets\":{count},"))
    );
}

#[test]
fn the_last_mesh_is_saved_in_every_format() {
    let sandbox = Sandbox::with_scene();
    for name in ["last.vtk", "last.vtu", "last.node", "LAST.VTU"] {
        sandbox.good(&[
            "run",
            "scene.toml",
            "--frames",
            "3",
            "--quiet",
            "--save-mesh",
            name,
        ]);
    }
    assert_eq!(
        sandbox.names("."),
        [
            "LAST.VTU",
            "last.ele",
            "last.node",
            "last.vtk",
            "last.vtu",
            "out",
            "scene.toml"
        ]
    );
    assert!(sandbox.read("last.vtu").contains("Name=\"position\""));
    assert!(sandbox.read("last.vtu") == sandbox.read("LAST.VTU"));
    // What was saved is the cut mesh, at rest, and sound.
    for name in ["last.vtk", "last.node"] {
        let info = sandbox.good(&["mesh", "info", name, "--json"]);
        assert!(info.contains("\"pieces\":2"), "{info}");
    }
}

/// Particles whose tets were all removed are in no saved mesh; the tets are those of the simulation, with the same corners
/// at the same places.
#[test]
fn meshes_saved_after_a_removal_have_no_unused_particles() {
    let sandbox = Sandbox::new();
    let scene = SCENE.to_owned()
        + "[[stroke]]\nkind = \"remove\"\nframe = 2\nregion = { sphere = { center = [0.3, 0.2, 0.1], radius = 0.5 } }\n";
    sandbox.write("scene.toml", &scene);
    let mut simulation = Simulation::new(&Scene::from_toml(&scene).unwrap()).unwrap();
    for _ in 0..4 {
        simulation.step().unwrap();
    }
    let mesh = simulation.mesh();
    let is_used: BTreeSet<_> = mesh.tets.iter().flatten().collect();
    let unused = mesh.positions.len() - is_used.len();
    assert!(unused > 5, "the scene leaves {unused} unused particles");
    let corners = |mesh: &TetMesh, positions: &[DVec3]| -> Vec<[DVec3; 4]> {
        let corners = mesh
            .tets
            .iter()
            .map(|tet| tet.map(|p| positions[p.index()]));
        corners.collect()
    };
    let at_rest = corners(mesh, &mesh.positions);
    let deformed = corners(mesh, simulation.positions());
    for name in ["last.vtk", "last.vtu", "last.node"] {
        let run = "run scene.toml --frames 4 --quiet --no-pictures --out out --save-mesh";
        let arguments: Vec<&str> = run.split(' ').chain([name]).collect();
        sandbox.good(&arguments);
        for (name, expected) in [(name, &at_rest), ("out/mesh.vtu", &deformed)] {
            let saved = incise::mesh_io::read(sandbox.path(name)).unwrap();
            assert_eq!(saved.positions.len(), is_used.len(), "{name}");
            assert!(corners(&saved, &saved.positions) == *expected, "{name}");
        }
    }
    // The deformed positions of a .vtu file are as many.
    let text = sandbox.read("last.vtu");
    let count = format!("NumberOfPoints=\"{}\"", is_used.len());
    assert!(text.contains(&count) && text.contains("Name=\"position\""));
}

#[test]
fn the_same_lines_may_be_asked_for_twice() {
    let sandbox = Sandbox::with_scene();
    sandbox.good(&[
        "run",
        "scene.toml",
        "--frames",
        "3",
        "--quiet",
        "--jsonl",
        "out/frames.jsonl",
    ]);
    assert_eq!(sandbox.read("out/frames.jsonl").lines().count(), 3);
    assert!(
        sandbox
            .names("out")
            .iter()
            .all(|name| !name.contains("partial"))
    );
}

/// A folder in the sandbox of a surface makes the run fail in its middle.
#[test]
fn a_failed_run_leaves_nothing_half_written() {
    let sandbox = Sandbox::with_scene();
    fs::create_dir_all(sandbox.path("out/surface_00002.vtp/full")).unwrap();
    sandbox.write("lines.jsonl", "of an earlier run\n");
    let outcome = sandbox.incise(&[
        "run",
        "scene.toml",
        "--frames",
        "4",
        "--jsonl",
        "lines.jsonl",
        "--save-mesh",
        "last.vtk",
        "--animation",
        "animation.gif",
        "--size",
        "64x48",
    ]);
    assert_eq!(
        (outcome.code, outcome.stdout.as_str()),
        (1, ""),
        "{outcome:?}"
    );
    assert_eq!(outcome.stderr.lines().count(), 1, "{outcome:?}");
    assert!(outcome.stderr.contains("surface_00002.vtp"), "{outcome:?}");
    let left = [
        "frame_00000.png",
        "frame_00001.png",
        "scene.toml",
        "surface_00000.vtp",
        "surface_00001.vtp",
        "surface_00002.vtp",
    ];
    assert_eq!(sandbox.names("out"), left);
    assert_eq!(sandbox.names("."), ["lines.jsonl", "out", "scene.toml"]);
    assert_eq!(sandbox.read("lines.jsonl"), "of an earlier run\n");
    for whole in &left[3..5] {
        assert!(
            sandbox
                .read(&format!("out/{whole}"))
                .trim_end()
                .ends_with("</VTKFile>")
        );
    }
}

/// A free box falls: displacements and velocities of its files are those of the closed form, it is not stretched, and the
/// tags of a cut are those of the simulation.
#[test]
fn files_have_piece_stretch_displacement_velocity_and_cut() {
    let sandbox = Sandbox::with_scene();
    let run = "run scene.toml --frames 3 --quiet --no-pictures";
    sandbox.good(&run.split(' ').collect::<Vec<_>>());
    let surface = sandbox.read("out/surface_00002.vtp");
    for name in ["displacement", "velocity", "cut", "piece", "stretch"] {
        assert!(surface.contains(&format!("Name=\"{name}\"")), "{name}");
    }
    let file = incise::mesh_io::read_file(sandbox.path("out/mesh.vtu")).unwrap();
    let scalars = |fields: &[NamedValues], name: &str| -> Vec<f64> {
        match &fields
            .iter()
            .find(|field| field.name == name)
            .unwrap()
            .values
        {
            OwnedValues::Scalars(values) => values.clone(),
            OwnedValues::Vectors(_) => panic!("{name} are vectors"),
        }
    };
    let vectors = |name: &str| -> Vec<DVec3> {
        match &file
            .particles
            .iter()
            .find(|field| field.name == name)
            .unwrap()
            .values
        {
            OwnedValues::Vectors(values) => values.clone(),
            OwnedValues::Scalars(_) => panic!("{name} are scalars"),
        }
    };
    let scene = Scene::from_toml(SCENE).unwrap();
    let mut simulation = Simulation::new(&scene).unwrap();
    for _ in 0..3 {
        simulation.step().unwrap();
    }
    let time = 3.0 * simulation.time_step();
    for velocity in vectors("velocity") {
        // Rounded to single precision, in each of some substeps.
        assert!(
            (velocity - DVec3::Z * -9.81 * time).length() < 1e-4,
            "{velocity}"
        );
    }
    let (rest, displacements) = (vectors("rest_position"), vectors("displacement"));
    for ((now, rest), displacement) in file.mesh.positions.iter().zip(rest).zip(displacements) {
        assert_eq!(*now - rest, displacement);
        // Between the ends of explicit and implicit steps of a fall.
        assert!((-0.02..-0.01).contains(&displacement.z), "{displacement}");
    }
    for stretch in scalars(&file.tets, "stretch") {
        assert!((stretch - 1.0).abs() < 1e-4, "{stretch}");
    }
    let pieces: Vec<f64> = simulation
        .piece_numbers()
        .into_iter()
        .map(f64::from)
        .collect();
    assert_eq!(scalars(&file.tets, "piece"), pieces);
    let on_cut = simulation
        .on_cut()
        .iter()
        .map(|&is| f64::from(u8::from(is)));
    assert!(scalars(&file.particles, "cut").into_iter().eq(on_cut));
}

#[test]
fn a_shorter_run_leaves_no_surface_of_the_longer_one() {
    let sandbox = Sandbox::with_scene();
    let run = |frames: &'static str| {
        [
            "run",
            "scene.toml",
            "--quiet",
            "--size",
            "64x48",
            "--frames",
            frames,
        ]
    };
    sandbox.good(&run("5"));
    sandbox.write("out/surface_mine.vtp", "kept");
    sandbox.good(&run("2"));
    let names = sandbox.names("out");
    let surfaces: Vec<_> = names.iter().filter(|name| name.ends_with(".vtp")).collect();
    assert_eq!(
        surfaces,
        ["surface_00000.vtp", "surface_00001.vtp", "surface_mine.vtp"]
    );
}
