//! The ranges that the schema states are those that a simulation accepts.

use incise::scene::schema;
use incise::{Scene, Simulation};
use serde_json::Value;

/// Scenes with a table each: the definition in the schema, the variant of it, and the text of the scene up to the table's
/// other keys. `KEY` is replaced by a key with its value.
const TABLES: [(&str, &str, &str); 19] = [
    ("CuttingSpec", "", "[cutting]\nKEY\n"),
    ("SolverSpec", "", "[solver]\nKEY\n"),
    ("ReclusterSpec", "", "[solver]\nrecluster = { KEY }\n"),
    ("SleepSpec", "", "[solver]\nsleep = { KEY }\n"),
    (
        "GroundSpec",
        "",
        "[world]\nground = { height = -1.0, KEY }\n",
    ),
    ("ReportSpec", "", "[report]\nKEY\n"),
    ("BodySpec", "", "BODY KEY\n"),
    (
        "MaterialSpec",
        "",
        "BODY material = [{ regions = [{ sphere = { center = [0, 0, 0], radius = 9 } }], KEY }]\n",
    ),
    (
        "ColliderSpec",
        "plane",
        "[[collider]]\nkind = \"plane\"\npoint = [0, 0, -3]\nnormal = [0, 0, 1]\nKEY\n",
    ),
    (
        "ColliderSpec",
        "sphere",
        "[[collider]]\nkind = \"sphere\"\ncenter = [0, 0, -3]\nradius = 0.1\nKEY\n",
    ),
    (
        "ColliderSpec",
        "capsule",
        "[[collider]]\nkind = \"capsule\"\nends = [[0, 0, -3], [1, 0, -3]]\nradius = 0.1\nKEY\n",
    ),
    (
        "ColliderSpec",
        "box",
        "[[collider]]\nkind = \"box\"\ncenter = [0, 0, -3]\nhalf_extents = [1, 1, 1]\nKEY\n",
    ),
    (
        "RotationSpec",
        "",
        "[[collider]]\nkind = \"box\"\ncenter = [0, 0, -3]\nhalf_extents = [1, 1, 1]\n\
         rotation = { axis = [0, 0, 1], angle_degrees = 1.0, KEY }\n",
    ),
    (
        "AttachmentSpec",
        "",
        "[[attachment]]\nregions = [{ sphere = { center = [0, 0, 0], radius = 9 } }]\nKEY\n",
    ),
    (
        "DistanceSpec",
        "",
        "[[distance]]\nfrom = { body = 0, point = [-1, 0, 0] }\nto = { body = 0, point = [1, 0, 0] }\nKEY\n",
    ),
    (
        "StrokeSpec",
        "plane",
        "[[stroke]]\nkind = \"plane\"\nframe = 1\npoint = [0, 0, 0]\nnormal = [1, 0, 0]\nKEY\n",
    ),
    (
        "StrokeSpec",
        "sweep",
        "[[stroke]]\nkind = \"sweep\"\nframes = [1, 3]\nblade = [[0, -1, 1], [0, 1, 1]]\npath = [[0, 0, 0], [0, 0, -2]]\nKEY\n",
    ),
    (
        "StrokeSpec",
        "punch",
        "[[stroke]]\nkind = \"punch\"\nframe = 1\nregion = { sphere = { center = [0, 0, 0], radius = 0.2 } }\nKEY\n",
    ),
    (
        "",
        "region",
        "BODY fixed = [{ sphere = { center = [0, 0, 0], KEY } }]\n",
    ),
];

/// What happens to a scene in which a key has a value: `None` if it is accepted, else the error.
fn outcome(table: &str, key: &str, value: f64, is_integer: bool) -> Option<String> {
    let value = if is_integer {
        format!("{value:.0}")
    } else {
        format!("{value:?}")
    };
    // A key that the table has already is replaced.
    let mut text = table.replace("BODY ", "");
    for before in ["\n", ", ", "{ "] {
        let named = format!("{before}{key} = ");
        if let Some(start) = text.find(&named) {
            let value = start + named.len();
            let end = value + text[value..].find([',', '\n', '}']).unwrap();
            match before {
                "{ " => text.replace_range(start + 2..end + 2, ""),
                _ => text.replace_range(start..end, ""),
            }
        }
    }
    let text = text.replace("KEY", &format!("{key} = {value}"));
    let body = "[[body]]\nshape = { kind = \"box\", tets = 300 }\n";
    let text = if table.starts_with("BODY") {
        format!("{body}{text}")
    } else {
        format!("{text}{body}")
    };
    let made = Scene::from_toml(&text).and_then(|scene| Simulation::new(&scene));
    made.err().map(|error| format!("{error}\n{text}"))
}

/// A table of the schema.
fn table<'a>(schema: &'a Value, name: &str, variant: &str) -> &'a Value {
    let definitions = &schema["definitions"];
    let region = &definitions["Region"]["oneOf"];
    if variant == "region" {
        let spheres = region.as_array().unwrap().iter();
        let mut spheres = spheres.map(|choice| &choice["properties"]["sphere"]);
        return spheres.find(|sphere| sphere.is_object()).unwrap();
    }
    let definition = &definitions[name];
    match definition["oneOf"].as_array() {
        None => definition,
        Some(variants) => {
            let mut variants = variants.iter();
            let is_it = |v: &&Value| v["properties"]["kind"]["const"] == variant;
            variants.find(is_it).unwrap()
        }
    }
}

#[test]
fn stated_ranges_are_the_accepted_ones() {
    let schema = schema();
    let mut checked = 0;
    for (name, variant, text) in TABLES {
        let keys = table(&schema, name, variant)["properties"]
            .as_object()
            .unwrap();
        for (key, schema) in keys {
            let is_integer = schema["type"] == "integer";
            if !is_integer && schema["type"] != "number" {
                continue;
            }
            // Sleep, Chebyshev and others are read only where they are used.
            let text = match &key[..] {
                "spectral_radius" | "chebyshev_start" => {
                    text.replace("KEY", "method = \"chebyshev\"\nKEY")
                }
                _ => text.to_owned(),
            };
            let beyond = |limit: f64, sign: f64| {
                if is_integer {
                    limit + sign
                } else {
                    limit + sign * (1e-3 * limit.abs()).max(1e-12)
                }
            };
            for (limit, sign, is_open) in [
                ("minimum", -1.0, false),
                ("exclusiveMinimum", -1.0, true),
                ("maximum", 1.0, false),
                ("exclusiveMaximum", 1.0, true),
            ] {
                let Some(limit) = schema[limit].as_f64() else {
                    continue;
                };
                let bad = if is_open { limit } else { beyond(limit, sign) };
                let refused = outcome(&text, key, bad, is_integer);
                let refused = refused.unwrap_or_else(|| panic!("{name}.{key} = {bad} is accepted"));
                let sentence = refused.lines().next().unwrap();
                // A value that its type refuses is named by its line.
                assert!(
                    sentence.contains(&key[..]) || sentence.contains("expected a whole number"),
                    "{name}.{key} = {bad}: {refused}"
                );
                // A body of 1e9 m may be refused for another reason, but not by this range.
                let good = if is_open { beyond(limit, -sign) } else { limit };
                if let Some(error) = outcome(&text, key, good, is_integer) {
                    let other = [("BodySpec", "scale")];
                    assert!(
                        other.contains(&(name, key)),
                        "{name}.{key} = {good}: {error}"
                    );
                }
                checked += 1;
            }
        }
    }
    assert!(checked > 60, "{checked}");
}

#[test]
fn types_without_null() {
    fn visit(value: &Value) {
        match value {
            Value::Object(map) => map.values().for_each(visit),
            Value::Array(items) => items.iter().for_each(visit),
            value => assert_ne!(value, "null"),
        }
    }
    visit(&schema());
}
