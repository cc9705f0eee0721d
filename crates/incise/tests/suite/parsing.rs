//! What a scene file may say, and what it is told when it says something else.

use std::fs;
use std::path::Path;

use incise::mesh_io;
use incise::meshing::{Shape, generate};
use incise::scene::{Method, Precision, StrokeSpec, TetSolve};
use incise::{Error, Scene, Simulation};

use crate::support::{body, scene};

#[test]
fn defaults_are_the_documented_ones() {
    let parsed = scene(
        &(body("box", 300, [0.0, 0.0, 0.0])
            + "[[stroke]]\nkind = \"plane\"\nframe = 3\npoint = [0, 0, 0]\nnormal = [0, 0, 1]"),
    );
    let solver = &parsed.solver;
    assert_eq!(
        (solver.time_step, solver.substeps, solver.iterations),
        (0.016, incise::scene::Substeps::Auto, 1)
    );
    assert_eq!((solver.method, solver.relaxation), (Method::Auto, 1.0));
    assert_eq!(
        (
            solver.tet_solve,
            solver.spectral_radius,
            solver.chebyshev_start
        ),
        (TetSolve::Split, 0.99, 10)
    );
    assert_eq!(
        (solver.clustering.as_str(), solver.coloring.as_str()),
        ("pressure:10", "auto")
    );
    assert_eq!(
        (solver.precision, solver.kappa_limit),
        (Precision::Auto, f64::INFINITY)
    );
    assert_eq!(solver.max_substeps, 200);
    assert_eq!((parsed.world.gravity, parsed.world.ground), (None, None));
    assert_eq!(
        (parsed.report.every, parsed.report.quantities.len()),
        (1, 0)
    );
    let bare = scene("[[body]]\nshape = { kind = \"box\", tets = 300 }");
    let body = &bare.body[0];
    assert_eq!(
        (body.scale, body.position, body.damping),
        (1.0, [0.0; 3], 0.0)
    );
    assert_eq!(
        (body.young_modulus, body.poisson_ratio, body.density),
        (1e5, 0.45, 1000.0)
    );
    assert!(body.fixed.is_empty() && body.mesh.is_none() && body.substeps.is_none());
    let StrokeSpec::Plane { snap, .. } = parsed.stroke[0] else {
        panic!("not a plane")
    };
    assert_eq!(snap, 0.1);
    assert_eq!((parsed.frames_needed(), bare.frames_needed()), (4, 0));
}

/// Everything a scene can say, with no value at its default.
const EVERYTHING: &str = r#"
[report]
every = 10
quantities = ["residual", "energy", "volume", "speed", "kappa"]
[world]
gravity = [0.0, 0.5, -9.81]
ground = { height = -1.5, friction = 0.5 }
[solver]
time_step = 0.01
substeps = "auto"
max_substeps = 70
iterations = 2
method = "chebyshev"
tet_solve = "sequential"
relaxation = 0.9
spectral_radius = 0.9
chebyshev_start = 3
clustering = "serial:5"
coloring = "greedy"
precision = "f64"
kappa_limit = inf
sleep = { speed = 0.01, time = 0.2 }
[[body]]
mesh = "liver.vtk"
scale = 0.1
position = [1.0, 2.0, 3.0]
young_modulus = 2e4
poisson_ratio = 0.3
density = 1050.0
damping = 0.001
substeps = 7
fixed = [
  { half_space = { point = [0, 0, -0.4], normal = [0, 0, -1] } },
  { box = { low = [0, 0, 0], high = [1, 1, 1] } },
  { sphere = { center = [0, 0, 0], radius = 0.5 } },
  { particles = [0, 4] },
]
[[body]]
shape = { kind = "torus", tets = 500 }
[[stroke]]
kind = "plane"
frame = 10
point = [0, 0, 0]
normal = [1, 0, 0]
snap = 0.2
[[stroke]]
kind = "sweep"
frames = [20, 80]
blade = [[0, -1, 0.6], [0, 1, 0.6], [0, 2, 0.7]]
path = [[0, 0, 0], [0, 0, -1.2]]
snap = 0.0
"#;

#[test]
fn everything_survives_a_round_trip() {
    let full = scene(EVERYTHING);
    assert_eq!(
        (
            full.body[0].fixed.len(),
            full.stroke.len(),
            full.frames_needed()
        ),
        (4, 2, 81)
    );
    assert_eq!(scene(&full.to_toml().unwrap()), full);
    // How often is kept even while nothing is reported.
    let only_every = scene("[report]\nevery = 7");
    assert_eq!(scene(&only_every.to_toml().unwrap()), only_every);
    let empty = scene("");
    assert_eq!(scene(&empty.to_toml().unwrap()), empty);
}

#[test]
fn an_unknown_key_at_any_level_names_the_nearest() {
    let whole = EVERYTHING;
    for (known, mistaken) in [
        ("[report]", "[raport]"),
        ("every", "evry"),
        ("quantities", "quantites"),
        ("residual", "residuals"),
        ("[world]", "[wold]"),
        ("gravity", "gravty"),
        ("height", "hight"),
        ("friction", "frction"),
        ("[solver]", "[slover]"),
        ("time_step", "timestep"),
        ("substeps", "sub_steps"),
        ("auto", "atuo"),
        ("max_substeps", "max_substep"),
        ("iterations", "iteration"),
        ("chebyshev", "chebychev"),
        ("tet_solve", "tet_slove"),
        ("sequential", "seqential"),
        ("spectral_radius", "spectral_radios"),
        ("chebyshev_start", "chebyshev_strat"),
        ("relaxation", "relaxtion"),
        ("clustering", "clusterng"),
        ("precision", "precison"),
        ("f64", "f46"),
        ("kappa_limit", "kapa_limit"),
        ("sleep", "sleeep"),
        ("young_modulus", "youngs_modulus"),
        ("poisson_ratio", "poison_ratio"),
        ("density", "densty"),
        ("damping", "dampning"),
        ("fixed", "fixd"),
        ("half_space", "half-space"),
        ("low", "lo"),
        ("center", "centr"),
        ("particles", "particle"),
        ("tets", "tet"),
        ("frame ", "frme "),
        ("sweep", "sweeep"),
        ("blade", "blad"),
        ("path", "pth"),
        ("snap", "snp"),
    ] {
        assert!(whole.contains(known), "{known}");
        let text = whole.replacen(known, mistaken, 1);
        let message = Scene::from_toml(&text).unwrap_err().to_string();
        let known = known.trim_matches(['[', ']', ' ']);
        let mistaken = mistaken.trim_matches(['[', ']', ' ']);
        assert!(
            message.contains(&format!("'{mistaken}': did you mean '{known}'?"))
                && !message.contains('\n'),
            "{message}"
        );
    }
}

#[test]
fn wrong_types_and_missing_keys_are_named_in_one_line() {
    for (text, part) in [
        ("[world]\ngravity = 9.81", "line 2"),
        ("[world]\ngravity = [0, 0]", "line 2"),
        ("[world]\nground = {}", "height"),
        ("[solver]\nsubsteps = -1", "line 2"),
        ("[solver]\nsubsteps = 1.5", "\"auto\""),
        ("[solver]\nsubsteps = 5000000000", "line 2"),
        ("[solver]\nsubsteps = [1]", "\"auto\""),
        ("[report]\nevery = -1", "line 2"),
        ("[[body]]\nshape = { kind = \"box\" }", "tets"),
        ("[[body]]\nshape = \"box\"", "line 2"),
        ("[[stroke]]\nframe = 1", "kind"),
        ("[[stroke]]\nkind = \"plane\"\nframe = 1", "point"),
        ("[[stroke]]\nkind = \"sweep\"\nframes = [1]", "line"),
        ("[world]\n[world]", "line 2"),
        ("= 3", "line 1"),
    ] {
        let error = Scene::from_toml(text).unwrap_err();
        let message = error.to_string();
        assert!(matches!(error, Error::Parse { .. }));
        assert!(
            message.contains(part) && !message.contains('\n'),
            "{text:?}: {message:?}"
        );
    }
}

#[test]
fn mesh_files_are_relative_to_the_scene_file() {
    let folder = tempfile::tempdir().unwrap();
    let below = folder.path().join("meshes");
    fs::create_dir(&below).unwrap();
    let mesh = generate(Shape::Box, 300).unwrap();
    mesh_io::write(below.join("box.vtk"), &mesh).unwrap();
    let file = folder.path().join("scene.toml");
    fs::write(&file, "[[body]]\nmesh = \"meshes/box.vtk\"").unwrap();
    let scene = Scene::load(&file).unwrap();
    assert_eq!(
        scene.body[0].mesh.as_deref(),
        Some(below.join("box.vtk").as_path())
    );
    assert_eq!(*Simulation::new(&scene).unwrap().mesh(), mesh);
}

#[test]
fn a_file_that_is_no_scene_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("none.toml");
    let error = Scene::load(&missing).unwrap_err();
    assert!(
        matches!(&error, Error::Read { path, .. } if *path == missing),
        "{error:?}"
    );
    assert!(error.to_string().contains("none.toml"));
    let binary = folder.path().join("binary.toml");
    fs::write(&binary, [0xff, 0xfe, 0x00]).unwrap();
    assert!(matches!(
        Scene::load(&binary).unwrap_err(),
        Error::Read { .. }
    ));
    assert!(Scene::load(Path::new("")).is_err());
}
