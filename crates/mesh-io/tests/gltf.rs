//! glTF files: written ones by the crate `gltf`, which checks them, too; read ones against matrices of glam.

use std::fs;
use std::path::Path;

use gltf::{Gltf, Semantic};
use incise_mesh::glam::{DMat4, DQuat, DVec2, DVec3, Vec3};
use incise_mesh::{ParticleId, TetMesh, TriangleSurface, kuhn_box};
use incise_mesh_io::{MeshIoError, SurfaceFile, parse_surface_file, read_surface_file};

/// What a file has in it: positions, normals, indices.
type Content = (Vec<Vec3>, Vec<Vec3>, Vec<u32>);

fn written(name: &str, surface: &TriangleSurface) -> Content {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = folder.path().join(name);
    incise_mesh_io::write_surface(&path, surface).expect("the surface can be written");
    content(&path)
}

fn content(path: &Path) -> Content {
    let bytes = fs::read(path).expect("the file was written");
    let file = Gltf::from_slice(&bytes).expect("the file is sound");
    let buffer = file.buffers().next().expect("there is a buffer");
    let numbers = match (buffer.source(), &file.blob) {
        (gltf::buffer::Source::Bin, Some(blob)) => blob.clone(),
        (gltf::buffer::Source::Uri(uri), None) => {
            let start = "data:application/octet-stream;base64,";
            decoded(
                uri.strip_prefix(start)
                    .expect("the numbers are in the file"),
            )
        }
        _ => panic!("the numbers are in one place"),
    };
    assert_eq!(numbers.len(), buffer.length());
    let mesh = file.meshes().next().expect("there is a mesh");
    let primitive = mesh.primitives().next().expect("there are triangles");
    let reader = primitive.reader(|_| Some(&numbers));
    let positions: Vec<_> = reader
        .read_positions()
        .expect("positions")
        .map(Vec3::from)
        .collect();
    let normals = reader
        .read_normals()
        .expect("normals")
        .map(Vec3::from)
        .collect();
    let indices = reader.read_indices().expect("indices").into_u32().collect();

    let accessor = primitive.get(&Semantic::Positions).expect("positions");
    // As floats: serde_json is off by a bit of the double where it is not asked for exactness.
    #[expect(clippy::cast_possible_truncation, reason = "what readers do")]
    let bound = |value: Option<gltf::json::Value>| -> Vec<f32> {
        let value = value.expect("bounds are told");
        let numbers = value.as_array().expect("a vector").iter();
        numbers
            .map(|number| number.as_f64().expect("a number") as f32)
            .collect()
    };
    let low = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let high = positions
        .iter()
        .copied()
        .fold(Vec3::NEG_INFINITY, Vec3::max);
    assert_eq!(bound(accessor.min()), low.to_array());
    assert_eq!(bound(accessor.max()), high.to_array());
    (positions, normals, indices)
}

/// Base64, by the table of RFC 4648.
fn decoded(text: &str) -> Vec<u8> {
    let digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let value = |c: char| digits.find(c).expect("a digit");
    let bits = text
        .trim_end_matches('=')
        .chars()
        .flat_map(|c| (0..6).rev().map(move |i| value(c) >> i & 1));
    let bits: Vec<_> = bits.collect();
    let byte = |bits: &[usize]| {
        bits.iter()
            .fold(0, |byte, &bit| byte << 1 | u8::from(bit == 1))
    };
    bits.chunks_exact(8).map(byte).collect()
}

/// A ball around the origin: a box of cells, each point drawn towards the center until the cubes around it are balls.
fn ball() -> TetMesh {
    let mut mesh = kuhn_box([10, 10, 10], DVec3::splat(2.0));
    for p in &mut mesh.positions {
        *p -= DVec3::ONE;
        *p *= p.abs().max_element() / p.length().max(f64::MIN_POSITIVE);
    }
    mesh
}

#[test]
fn the_boundary_of_a_mesh() {
    let mesh = ball();
    let surface = TriangleSurface::boundary_of(&mesh);
    let binary = written("a.glb", &surface);
    assert_eq!(binary, written("a.GLTF", &surface));
    let (positions, normals, indices) = binary;
    // The particles of the boundary alone, in their order, rounded to floats.
    let mut used: Vec<_> = surface.triangles.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    assert!(used.len() < mesh.positions.len());
    let expected: Vec<_> = used
        .iter()
        .map(|p| mesh.positions[p.index()].as_vec3())
        .collect();
    assert_eq!(positions, expected);
    let corners: Vec<_> = indices.iter().map(|&i| used[i as usize]).collect();
    assert_eq!(corners, surface.triangles.as_flattened());
    for (position, normal) in positions.iter().zip(&normals) {
        // Rounded to floats a unit vector has the length 1 to within three roundings.
        assert!((normal.length() - 1.0).abs() < 4.0 * f32::EPSILON);
        // A ball around the origin of triangles up to 15 degrees wide: the normals lie about on the radii.
        assert!(
            normal.dot(position.normalize()) > 0.97,
            "{position} {normal}"
        );
    }
}

#[test]
fn points_without_triangles_or_direction() {
    let surface = TriangleSurface {
        positions: vec![
            DVec3::NAN,
            DVec3::X,
            DVec3::splat(0.1),
            DVec3::splat(1e-200),
            -DVec3::ZERO,
        ],
        triangles: vec![[1, 2, 3].map(ParticleId), [4; 3].map(ParticleId)],
    };
    for name in ["a.glb", "a.gltf"] {
        let (positions, normals, indices) = written(name, &surface);
        assert_eq!(
            positions,
            [Vec3::X, Vec3::splat(0.1), Vec3::ZERO, Vec3::ZERO]
        );
        assert_eq!(normals[3], Vec3::Z);
        assert_eq!(indices, [0, 1, 2, 3, 3, 3]);
    }
}

#[test]
fn unsupported_content_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let far = TriangleSurface::boundary_of(&kuhn_box([1, 1, 1], DVec3::splat(1e39)));
    for (surface, expected) in [
        (far, "too far away for 32 bits"),
        (
            TriangleSurface::boundary_of(&TetMesh::default()),
            "has no triangles",
        ),
    ] {
        let Err(MeshIoError::Io { source, .. }) = incise_mesh_io::write_surface(&path, &surface)
        else {
            panic!("it is written");
        };
        assert!(source.to_string().contains(expected), "{source}");
        assert!(!path.exists());
    }
    let error = incise_mesh_io::write_surface("a.step", &TriangleSurface::default()).unwrap_err();
    assert!(error.to_string().contains(".off, .glb, .gltf"), "{error}");
}

/// A surface survives, rounded to floats, with its texture coordinates, where a seam splits points.
#[test]
fn written_surfaces_are_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = SurfaceFile::from(TriangleSurface::boundary_of(&ball()));
    for has_texture in [false, true] {
        if has_texture {
            // Multiples of 2^-10 and their differences from 1 are exact floats; each triangle has coordinates of its own.
            file.texture_corners = (0..)
                .take(file.surface.triangles.len())
                .map(|t| [t, t + 1, t + 2])
                .collect();
            file.texture = (0..file.surface.triangles.len() + 2)
                .map(|i| DVec2::new(i as f64, 7.0 * i as f64 % 11.0) / 1024.0)
                .collect();
        }
        for name in ["a.glb", "a.gltf", "a.obj"] {
            let path = folder.path().join(name);
            incise_mesh_io::write_surface_file(&path, &file).unwrap();
            let read = read_surface_file(&path).unwrap();
            read.check().unwrap();
            assert_eq!(read.surface.triangles.len(), file.surface.triangles.len());
            for (t, triangle) in file.surface.triangles.iter().enumerate() {
                let expected = triangle.map(|p| {
                    let position = file.surface.positions[p.index()];
                    if name == "a.obj" {
                        position
                    } else {
                        position.as_vec3().as_dvec3()
                    }
                });
                let found = read.surface.triangles[t].map(|p| read.surface.positions[p.index()]);
                assert_eq!(found, expected, "{name}");
                assert_eq!(read.texture_of(t), file.texture_of(t), "{name}");
            }
            assert_eq!(read.texture_corners.is_empty(), !has_texture);
        }
    }
}

/// A scene of one buffer: six points, indices of one byte, texture coordinates of two.
fn scene(nodes: &str, primitives: &str, uri: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{nodes}],
        "meshes":[{{"primitives":[{primitives}]}}],
        "buffers":[{{"byteLength":104,"uri":"{uri}"}}],
        "bufferViews":[{{"buffer":0,"byteLength":72}},{{"buffer":0,"byteOffset":72,"byteLength":8}},
        {{"buffer":0,"byteOffset":80,"byteLength":24}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":6,"type":"VEC3","min":[0,0,0],"max":[9,9,9]}},
        {{"bufferView":1,"componentType":5121,"count":6,"type":"SCALAR"}},
        {{"bufferView":2,"componentType":5123,"count":6,"type":"VEC2","normalized":true}}]}}"#
    )
}

fn points() -> [Vec3; 6] {
    [
        [0, 0, 0],
        [1, 0, 0],
        [0, 2, 0],
        [0, 0, 3],
        [1, 2, 3],
        [5, 4, 1],
    ]
    .map(|[x, y, z]| Vec3::new(x as f32, y as f32, z as f32))
}

fn buffer() -> Vec<u8> {
    let mut bytes: Vec<u8> = points()
        .iter()
        .flat_map(|p| p.to_array())
        .flat_map(f32::to_le_bytes)
        .collect();
    bytes.extend([0, 1, 2, 3, 4, 5, 0, 0]);
    for i in 0..6_u16 {
        bytes.extend((i * 13_107).to_le_bytes());
        bytes.extend(0_u16.to_le_bytes());
    }
    bytes
}

/// Files with their numbers beside them, in a folder.
fn read(nodes: &str, primitives: &str) -> Result<SurfaceFile, MeshIoError> {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let path = folder.path().join("a.gltf");
    fs::write(folder.path().join("the numbers.bin"), buffer()).expect("the folder is there");
    let text = scene(nodes, primitives, "the%20numbers.bin");
    fs::write(&path, text).expect("the folder is there");
    read_surface_file(&path)
}

const ALL: &str = r#"{"attributes":{"POSITION":0,"TEXCOORD_0":2},"indices":1}"#;

/// The third axis up.
fn upright(p: DVec3) -> DVec3 {
    DVec3::new(p.x, -p.z, p.y)
}

#[test]
fn nodes_place_their_meshes() {
    let nodes = r#"{"children":[1,2],"translation":[1,2,3],"rotation":[0.1,0.7,-0.3,0.4],"scale":[2,1,0.5]},
        {"mesh":0,"matrix":[0,1,0,0, -1,0,0,0, 0,0,2,0, 4,5,6,1]},
        {"mesh":0,"scale":[-1,1,1]}"#;
    let file = read(nodes, ALL).unwrap();
    file.check().unwrap();
    let outer = DMat4::from_scale_rotation_translation(
        DVec3::new(2.0, 1.0, 0.5),
        DQuat::from_array([0.1_f32, 0.7, -0.3, 0.4].map(f64::from)).normalize(),
        DVec3::new(1.0, 2.0, 3.0),
    );
    let first = DMat4::from_cols_array(&[
        0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 4.0, 5.0, 6.0, 1.0,
    ]);
    let second = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let expected = [first, second].into_iter().flat_map(|inner| {
        points().map(|p| upright((outer * inner).transform_point3(p.as_dvec3())))
    });
    assert_eq!(file.surface.positions.len(), 12);
    for (found, expected) in file.surface.positions.iter().zip(expected) {
        // Coordinates up to 30, some ten roundings.
        assert!((*found - expected).length() < 1e-13, "{found} {expected}");
    }
    // The mirrored copy has its triangles the other way round, with their texture.
    let triangles: Vec<_> = file
        .surface
        .triangles
        .iter()
        .map(|t| t.map(|p| p.0))
        .collect();
    assert_eq!(triangles, [[0, 1, 2], [3, 4, 5], [6, 8, 7], [9, 11, 10]]);
    let texture = file.texture_of(2).unwrap();
    // Unsigned 16-bit numbers of a fifth each, measured from the upper corner.
    let expected = [0.0, 0.4, 0.2].map(|u| DVec2::new(u, 1.0));
    for (found, expected) in texture.iter().zip(expected) {
        assert!((*found - expected).length() < 1e-15);
    }
}

#[test]
fn strips_fans_and_shared_points() {
    let part = |rest: &str| format!(r#"{{"attributes":{{"POSITION":0}}{rest}}}"#);
    let parts = [
        part(r#","mode":5"#),
        part(r#","mode":6,"indices":1"#),
        // Lines are no surface.
        part(r#","mode":1"#),
        part(""),
    ];
    let file = read(r#"{"mesh":0}"#, &parts.join(",")).unwrap();
    assert_eq!(file.surface.positions.len(), 6);
    let triangles: Vec<_> = file
        .surface
        .triangles
        .iter()
        .map(|t| t.map(|p| p.0))
        .collect();
    assert_eq!(triangles[..4], [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]]);
    assert_eq!(
        triangles[4..8],
        [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]
    );
    assert_eq!(triangles[8..], [[0, 1, 2], [3, 4, 5]]);
    assert!(file.texture.is_empty() && file.texture_corners.is_empty());
}

#[test]
fn wrong_scenes_are_refused_with_their_place() {
    let one = r#"{"mesh":0}"#;
    let missing = r#"{"attributes":{"NORMAL":0}}"#;
    let sizes = r#"{"attributes":{"POSITION":0,"TEXCOORD_0":1}}"#;
    let copies = vec![one; 4000].join(",");
    let children = (1..=4000)
        .map(|i| i.to_string())
        .collect::<Vec<_>>()
        .join(",");
    for (nodes, primitives, expected) in [
        (
            r#"{"children":[0]}"#,
            ALL,
            "nodes[0] is a child of two nodes",
        ),
        (
            r#"{"children":[1,1]},{"mesh":0}"#,
            ALL,
            "nodes[1] is a child of two nodes",
        ),
        (r#"{"mesh":7}"#, ALL, "nodes[0].mesh"),
        (one, missing, "POSITION"),
        (
            one,
            r#"{"attributes":{"POSITION":7}}"#,
            "meshes[0].primitives[0] has accessor 7, there are 3",
        ),
        (one, sizes, "type"),
        (
            one,
            r#"{"attributes":{"POSITION":0},"mode":0}"#,
            "no triangles",
        ),
        (r#"{"mesh":0,"translation":[1e39,0,0]}"#, ALL, "a.gltf:"),
        (
            r#"{"mesh":0,"scale":[3e38,1,1],"translation":[3e38,0,0]},"#,
            ALL,
            "a.gltf:",
        ),
        (
            &format!(r#"{{"children":[{children}]}},{copies}"#),
            ALL,
            "repeats its meshes",
        ),
    ] {
        let error = read(nodes, primitives).map(drop).unwrap_err();
        assert!(error.to_string().contains(expected), "{expected}: {error}");
    }
    // In memory there is no other file, and none outside of the folder is read.
    let text = scene(one, ALL, "../numbers.bin");
    let error = parse_surface_file("a.gltf", text.as_bytes()).unwrap_err();
    assert!(error.to_string().contains("in another file"), "{error}");
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("scene")).unwrap();
    fs::write(folder.path().join("numbers.bin"), buffer()).unwrap();
    fs::write(folder.path().join("scene/a.gltf"), text).unwrap();
    let error = read_surface_file(folder.path().join("scene/a.gltf")).unwrap_err();
    assert!(error.to_string().contains("in another file"), "{error}");
}

/// Any part of a file is an error and no panic, and so is a file with another byte in its numbers or a surface.
#[test]
fn damaged_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = kuhn_box([1, 1, 1], DVec3::ONE);
    for name in ["a.glb", "a.gltf"] {
        let path = folder.path().join(name);
        incise_mesh_io::write_surface(&path, &TriangleSurface::boundary_of(&mesh)).unwrap();
        let bytes = fs::read(&path).unwrap();
        for end in 0..bytes.len() {
            let error = parse_surface_file(name, &bytes[..end]).unwrap_err();
            assert!(error.to_string().starts_with(name), "{error}");
        }
        for at in 0..bytes.len() {
            for value in [0, b'0', b'9', b'-', 0xff] {
                let mut other = bytes.clone();
                other[at] = value;
                if let Ok(file) = parse_surface_file(name, &other) {
                    file.check().unwrap();
                    let count = file.surface.positions.len();
                    let corners = file.surface.triangles.as_flattened();
                    assert!(corners.iter().all(|p| p.index() < count));
                }
            }
        }
    }
}
