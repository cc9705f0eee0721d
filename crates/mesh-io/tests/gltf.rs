//! glTF files, read back by the crate `gltf`, which checks them, too.

use std::fs;
use std::path::Path;

use gltf::{Gltf, Semantic};
use incise_mesh::glam::{DVec3, Vec3};
use incise_mesh::{ParticleId, TetMesh, TriangleSurface, kuhn_box};
use incise_mesh_io::MeshIoError;

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
    assert!(matches!(
        incise_mesh_io::read_surface(&path),
        Err(MeshIoError::UnknownFormat { .. })
    ));
    let error = incise_mesh_io::write_surface("a.step", &TriangleSurface::default()).unwrap_err();
    assert!(error.to_string().contains(".off, .glb, .gltf"), "{error}");
}
