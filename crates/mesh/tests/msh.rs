//! Gmsh files as Gmsh and meshio write them, compared with the mesh they were made of.

use incise_mesh::MeshError;
use incise_mesh::generate::kuhn_box;
use incise_mesh::glam::DVec3;
use incise_mesh::io::{self, MeshFile, MshKind};

use crate::given::folder;

#[test]
fn the_mesh_survives_other_programs() {
    let Some(folder) = folder() else { return };
    for name in ["liver_5k", "sphere_7k"] {
        let original = io::read(folder.join(format!("{name}.vtk"))).unwrap();
        for kind in [
            "gmsh22.ascii.msh",
            "gmsh22.bin.msh",
            "gmsh41.ascii.msh",
            "gmsh41.bin.msh",
            "meshio.gmsh22.ascii.msh",
            "meshio.gmsh41.ascii.msh",
        ] {
            let path = folder.join("formats").join(format!("{name}.{kind}"));
            let file = io::read_msh(&path).unwrap();
            // The original has 9 digits, which all of these writers keep, so that the doubles are the same.
            assert_eq!(file.mesh.positions, original.positions, "{name}.{kind}");
            assert_eq!(file.mesh.tets, original.tets, "{name}.{kind}");
            // Gmsh puts all into entity 1, which says nothing; meshio into entity 0.
            if kind.starts_with("meshio") {
                assert_eq!(file.regions, vec![0; original.tets.len()], "{name}.{kind}");
            } else {
                assert!(file.regions.is_empty(), "{name}.{kind}");
            }
            assert!(file.particles.is_empty() && file.tets.is_empty());
        }
    }
}

#[test]
fn fields_and_regions_of_the_wrong_length_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.msh");
    let mut file = MeshFile::from(kuhn_box([1, 1, 1], DVec3::ONE));
    file.regions = vec![1];
    for kind in [MshKind::Text41, MshKind::Binary22] {
        let error = io::write_msh(&path, &file, kind).unwrap_err();
        assert!(matches!(error, MeshError::FieldLength { found: 1, .. }));
        assert!(!path.exists());
    }
    assert!(matches!(io::read_msh(&path), Err(MeshError::Io { .. })));
}
