//! Round trips are bit-identical in every format that is written.

use std::path::Path;

use incise_mesh::glam::DVec3;
use incise_mesh::{ParticleId, TetMesh, TriangleSurface};
use incise_mesh_io::{MeshFile, MeshIoError, MshKind, NamedValues, OwnedValues, PlyEncoding};
use proptest::prelude::*;

/// Any finite double, all bit patterns alike, and often one that is hard to print or to keep.
fn number() -> impl Strategy<Value = f64> {
    let hard = [
        -0.0,
        0.1,
        1e300,
        5e-324,
        -2.5e-310,
        f64::MIN_POSITIVE,
        f64::MAX,
        f64::MIN,
        f64::EPSILON,
        1.0 - f64::EPSILON / 2.0,
    ];
    prop_oneof![
        any::<u64>()
            .prop_map(f64::from_bits)
            .prop_filter("finite", |c| c.is_finite()),
        prop::sample::select(hard.to_vec()),
    ]
}

fn vector() -> impl Strategy<Value = DVec3> {
    [number(), number(), number()].prop_map(DVec3::from)
}

fn fields(count: usize) -> impl Strategy<Value = Vec<NamedValues>> {
    let values = prop_oneof![
        prop::collection::vec(number(), count).prop_map(OwnedValues::Scalars),
        prop::collection::vec(vector(), count).prop_map(OwnedValues::Vectors),
    ];
    let field = ("[ -~äπ]{1,12}", values).prop_map(|(name, values)| NamedValues { name, values });
    prop::collection::vec(field, 0..4)
}

/// Any mesh, with particles that no tet uses and tets with a corner twice, and any values.
fn file() -> impl Strategy<Value = MeshFile> {
    (1..12_usize, 1..12_usize).prop_flat_map(|(particles, tets)| {
        let corner = (0..particles).prop_map(ParticleId::new);
        let corners = [corner.clone(), corner.clone(), corner.clone(), corner];
        let regions = prop_oneof![Just(Vec::new()), prop::collection::vec(any::<i32>(), tets)];
        (
            prop::collection::vec(vector(), particles),
            prop::collection::vec(corners, tets),
            regions,
            fields(particles),
            fields(tets),
        )
            .prop_map(|(positions, tets, regions, particles, of_tets)| MeshFile {
                mesh: TetMesh { positions, tets },
                regions,
                particles,
                tets: of_tets,
            })
    })
}

type Write = fn(&Path, &MeshFile) -> Result<(), MeshIoError>;
type Survivor = fn(&MeshFile) -> MeshFile;

/// All forms of meshes that are written, and what of a file survives in each.
const FORMS: [(&str, Write, Survivor); 12] = [
    (
        "a.vtk",
        |path, file| incise_mesh_io::write_file(path, file),
        Clone::clone,
    ),
    (
        "b.vtk",
        |path, file| incise_mesh_io::write(path, &file.mesh),
        the_mesh,
    ),
    (
        "c.vtk",
        |path, file| incise_mesh_io::write_vtk_binary(path, file),
        Clone::clone,
    ),
    (
        "a.vtu",
        |path, file| incise_mesh_io::write_file(path, file),
        Clone::clone,
    ),
    (
        "b.vtu",
        |path, file| incise_mesh_io::write_vtu_compressed(path, file),
        Clone::clone,
    ),
    (
        "a.msh",
        |path, file| incise_mesh_io::write_msh(path, file, MshKind::Text41),
        Clone::clone,
    ),
    (
        "b.msh",
        |path, file| incise_mesh_io::write_msh(path, file, MshKind::Binary41),
        Clone::clone,
    ),
    (
        "c.msh",
        |path, file| incise_mesh_io::write_msh(path, file, MshKind::Text22),
        Clone::clone,
    ),
    (
        "d.msh",
        |path, file| incise_mesh_io::write_msh(path, file, MshKind::Binary22),
        Clone::clone,
    ),
    (
        "a.node",
        |path, file| incise_mesh_io::write_file(path, file),
        of_tetgen,
    ),
    (
        "a.mesh",
        |path, file| incise_mesh_io::write_file(path, file),
        of_medit,
    ),
    (
        "a.meshb",
        |path, file| incise_mesh_io::write_file(path, file),
        of_medit,
    ),
];

fn the_mesh(file: &MeshFile) -> MeshFile {
    MeshFile::from(file.mesh.clone())
}

/// Regions, unless all are 0.
fn of_medit(file: &MeshFile) -> MeshFile {
    let mut survivor = the_mesh(file);
    if file.regions.iter().any(|&region| region != 0) {
        survivor.regions.clone_from(&file.regions);
    }
    survivor
}

/// Regions, and scalars without their names; the tets are turned.
fn of_tetgen(file: &MeshFile) -> MeshFile {
    let scalars = |fields: &[NamedValues]| {
        let scalars = fields
            .iter()
            .filter(|field| matches!(field.values, OwnedValues::Scalars(_)));
        let renamed = (1..).zip(scalars).map(|(i, field)| NamedValues {
            name: format!("attribute {i}"),
            values: field.values.clone(),
        });
        renamed.collect()
    };
    let mut survivor = MeshFile {
        mesh: file.mesh.clone(),
        regions: file.regions.clone(),
        particles: scalars(&file.particles),
        tets: scalars(&file.tets),
    };
    survivor.mesh.orient_positively();
    survivor
}

fn surface() -> impl Strategy<Value = TriangleSurface> {
    (1..12_usize).prop_flat_map(|particles| {
        let corner = (0..particles).prop_map(ParticleId::new);
        (
            prop::collection::vec(vector(), particles),
            prop::collection::vec([corner.clone(), corner.clone(), corner], 1..12),
        )
            .prop_map(|(positions, triangles)| TriangleSurface {
                positions,
                triangles,
            })
    })
}

/// The corners of all triangles, which is all that STL has.
fn soup(surface: &TriangleSurface) -> Vec<[f64; 3]> {
    let corners = surface.triangles.iter().flatten();
    corners
        .map(|p| surface.positions[p.index()].to_array())
        .collect()
}

/// The debug text of a double is its shortest exact one, with its sign.
fn text(value: &impl std::fmt::Debug) -> String {
    format!("{value:?}")
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..Default::default() })]

    #[test]
    fn meshes(file in file()) {
        let folder = tempfile::tempdir().unwrap();
        for (name, write, survivor) in FORMS {
            let path = folder.path().join(name);
            write(&path, &file).unwrap();
            prop_assert_eq!(text(&incise_mesh_io::read_file(&path).unwrap()), text(&survivor(&file)), "{}", name);
            prop_assert_eq!(text(&incise_mesh_io::read(&path).unwrap()), text(&survivor(&file).mesh), "{}", name);
        }
    }

    #[test]
    fn surfaces(surface in surface()) {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for (name, encoding) in [
            ("a.obj", None),
            ("a.off", None),
            ("a.ply", None),
            ("b.ply", Some(PlyEncoding::Ascii)),
            ("c.ply", Some(PlyEncoding::LittleEndian)),
            ("d.ply", Some(PlyEncoding::BigEndian)),
        ] {
            match encoding {
                Some(encoding) => incise_mesh_io::write_ply(path(name), &surface, encoding).unwrap(),
                None => incise_mesh_io::write_surface(path(name), &surface).unwrap(),
            }
            prop_assert_eq!(text(&incise_mesh_io::read_surface(path(name)).unwrap()), text(&surface), "{}", name);
        }
        // STL has no points: what survives are the corners of the triangles, equal ones as one particle.
        incise_mesh_io::write_surface(path("a.stl"), &surface).unwrap();
        let read = incise_mesh_io::read_surface(path("a.stl")).unwrap();
        prop_assert_eq!(text(&soup(&read)), text(&soup(&surface)));
        let mut distinct: Vec<_> = soup(&surface).iter().map(|p| p.map(f64::to_bits)).collect();
        distinct.sort_unstable();
        distinct.dedup();
        prop_assert_eq!(read.positions.len(), distinct.len());

        // Its binary form rounds them to floats, and refuses those that none can stand for.
        #[expect(clippy::cast_possible_truncation, reason = "what the format does")]
        let rounded: Vec<_> = soup(&surface).iter().map(|p| p.map(|c| c as f32)).collect();
        let written = incise_mesh_io::write_stl_binary(path("b.stl"), &surface);
        if rounded.iter().flatten().all(|c| c.is_finite()) {
            written.unwrap();
            let read = incise_mesh_io::read_surface(path("b.stl")).unwrap();
            let expected: Vec<_> = rounded.iter().map(|p| p.map(f64::from)).collect();
            prop_assert_eq!(text(&soup(&read)), text(&expected));
        } else {
            prop_assert!(written.is_err() && !path("b.stl").exists());
        }
    }

    #[test]
    fn binary_stl_of_floats(mut surface in surface(), floats: [f32; 36]) {
        for (position, floats) in surface.positions.iter_mut().zip(floats.as_chunks::<3>().0) {
            let finite = floats.map(|c| if c.is_finite() { c } else { -0.0 });
            *position = DVec3::from(finite.map(f64::from));
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.stl");
        incise_mesh_io::write_stl_binary(&path, &surface).unwrap();
        prop_assert_eq!(text(&soup(&incise_mesh_io::read_surface(&path).unwrap())), text(&soup(&surface)));
    }
}
