//! `incise mesh`: generating, converting and looking at meshes.

use serde_json::Value;

use crate::support::{Place, keys, names};

const KEYS: &str = "input, tets, particles, pieces, boundary_triangles, euler_characteristic, volume, min_altitude, \
                    min_dihedral_degrees, max_dihedral_degrees, worst_radius_ratio, max_tets_per_particle";

fn info(place: &Place, file: &str) -> Value {
    serde_json::from_str(&place.good(&["mesh", "info", file, "--json"])).unwrap()
}

#[test]
fn every_shape_is_generated_with_about_the_wanted_tets() {
    let place = Place::new();
    for (shape, euler) in [
        ("box", 2),
        ("beam", 2),
        ("sphere", 2),
        ("torus", 0),
        ("plate", 2),
        ("liver", 2),
    ] {
        let file = format!("{shape}.vtk");
        assert_eq!(
            place.good(&["mesh", "generate", shape, "--tets", "1500", &file]),
            ""
        );
        let report = info(&place, &file);
        let tets = report["tets"].as_u64().unwrap();
        assert!(tets.abs_diff(1500) <= 30, "{shape}: {tets}");
        assert_eq!(
            (
                report["pieces"].as_u64(),
                report["euler_characteristic"].as_i64()
            ),
            (Some(1), Some(euler)),
            "{shape}"
        );
        assert_eq!(report["input"], file);
        assert_eq!(keys(&report), names(KEYS));
    }
}

#[test]
fn converting_there_and_back_keeps_every_bit() {
    let place = Place::with_mesh();
    place.good(&["mesh", "convert", "box.vtk", "box.node"]);
    place.good(&["mesh", "convert", "box.ele", "back.vtk"]);
    assert!(place.read("box.vtk") == place.read("back.vtk"));
    place.good(&["mesh", "convert", "back.vtk", "box.vtu"]);
    assert!(place.read("box.vtu").contains("UnstructuredGrid"));
    let (mut a, mut b) = (info(&place, "box.vtk"), info(&place, "box.node"));
    assert_ne!(a["input"].take(), b["input"].take());
    assert_eq!(a, b);
    let files = ["back.vtk", "box.ele", "box.node", "box.vtk", "box.vtu"];
    assert_eq!(place.names("."), files);
}

#[test]
fn the_table_says_the_same() {
    let place = Place::with_mesh();
    let (table, report) = (
        place.good(&["mesh", "info", "box.vtk"]),
        info(&place, "box.vtk"),
    );
    for part in [
        format!("{}, {}", report["tets"], report["particles"]),
        "sound".into(),
        "pieces".into(),
    ] {
        assert!(table.contains(&part), "{part} is not in\n{table}");
    }
}

/// A written file replaces the one before it, also the one it was made from.
#[test]
fn a_mesh_may_be_converted_in_place() {
    let place = Place::with_mesh();
    let before = place.read("box.vtk");
    place.good(&["mesh", "convert", "box.vtk", "box.vtk"]);
    assert!(place.read("box.vtk") == before);
    assert_eq!(place.names("."), ["box.vtk"]);
}
