//! [`in_scene_words`]: messages of the TOML reader in the words of scene files.
//!
//! The reader speaks of Rust: `invalid value: integer -5, expected usize`. Those who write scenes know lists, tables,
//! numbers and keys. Cost: that of the message; for a key in the wrong table that of the schema.

use serde_json::Value;

use super::schema;
use crate::names::similar;

/// A message of the TOML reader about a wrong type or value, a missing key, or an unknown name, in the words of scene files;
/// other messages stay. An unknown name comes with the known one that is most similar, with the tables that have such a key,
/// or with all known ones, and a missing key with the others that are missing. `named` is the text that the message is about.
pub(super) fn in_scene_words(message: &str, named: &str) -> String {
    let message = message.trim_end().replace('\n', " ");
    if message == "duplicate key" {
        return format!("the key '{named}' is there twice");
    }
    if let Some(names) = message.strip_prefix("unexpected keys in table: ") {
        // From a table with one of several sets of keys: `unexpected keys in table: a, available keys: b, c`.
        let (unknown, known) = names
            .split_once(", available keys: ")
            .unwrap_or((names, ""));
        let first = unknown.split(", ").next().unwrap_or(unknown);
        return unknown_name(first, &known.split(", ").collect::<Vec<_>>(), named);
    }
    if message.starts_with("unknown") {
        // ``unknown field `a`, expected `b` or `c` ``.
        let mut names = message.split('`').skip(1).step_by(2);
        if let Some(unknown) = names.next() {
            return unknown_name(unknown, &names.collect::<Vec<_>>(), named);
        }
    }
    if message.starts_with("wanted exactly 1 element") {
        // Only a region is a table of one key.
        return "expected a table with one key, the kind of a region, and its values behind it, as in { sphere = { center = \
                [0, 0, 0], radius = 0.1 } }"
            .to_owned();
    }
    if let Some(field) = message.strip_prefix("missing field ") {
        return missing_keys(field.trim_matches('`'), named);
    }
    for beginning in ["invalid type: ", "invalid value: ", "invalid length "] {
        let parts = message.strip_prefix(beginning);
        if let Some((given, wanted)) = parts.and_then(|parts| parts.split_once(", expected ")) {
            if (given, wanted) == ("map", "a sequence") {
                return "expected a list, found a table: each of its tables begins with two brackets, as in [[body]]".to_owned();
            }
            let given = if beginning == "invalid length " {
                format!("a list of {given}")
            } else {
                given_value(given)
            };
            return format!("expected {}, found {given}", wanted_value(wanted));
        }
    }
    message
}

/// Names a missing key, and with it all others that its table lacks. `named` is the text of the table, or of one that it is in.
fn missing_keys(key: &str, named: &str) -> String {
    let schema = schema();
    let tables = schema["definitions"].as_object().into_iter().flatten();
    let kinds = tables.flat_map(|(_, table)| {
        let kinds = table["oneOf"].as_array().into_iter().flatten();
        std::iter::once(table).chain(kinds)
    });
    let outer = table_of(named);
    let inner = outer.iter().flatten();
    let given: Vec<&toml::Table> = outer
        .iter()
        .chain(inner.filter_map(|(_, value)| value.as_table()))
        .collect();
    let lacks = kinds.flat_map(|kind| given.iter().filter_map(|given| lacking(kind, given)));
    let mut lacks: Vec<Vec<&str>> = lacks.filter(|keys| keys.contains(&key)).collect();
    lacks.sort_unstable();
    lacks.dedup();
    match lacks.as_slice() {
        // Its keys show which table it is.
        [keys] if keys.len() > 1 => format!("the keys '{}' are missing", keys.join("', '")),
        _ => format!("the key '{key}' is missing"),
    }
}

/// The keys required of a table that are not among those given; `None` if it has no such keys.
fn lacking<'a>(kind: &'a Value, given: &toml::Table) -> Option<Vec<&'a str>> {
    let keys = kind["properties"].as_object()?;
    let fits = |(key, value): (&String, &toml::Value)| {
        let is_kind =
            |kind: &Value| kind["const"].is_null() || kind["const"].as_str() == value.as_str();
        keys.get(key).is_some_and(is_kind)
    };
    let required = kind["required"]
        .as_array()?
        .iter()
        .filter_map(Value::as_str);
    let lacking = required.filter(|key| !given.contains_key(*key)).collect();
    given.iter().all(fits).then_some(lacking)
}

/// The table that a text writes, in one line or under its heading.
fn table_of(text: &str) -> Option<toml::Table> {
    let inline = toml::from_str::<toml::Table>(&format!("table = {text}"));
    let table = inline.or_else(|_| toml::from_str(text)).ok()?;
    match table.into_iter().next()?.1 {
        toml::Value::Table(table) => Some(table),
        toml::Value::Array(tables) => tables.into_iter().next()?.try_into().ok(),
        _ => None,
    }
}

fn unknown_name(unknown: &str, known: &[&str], named: &str) -> String {
    let known: Vec<&str> = known
        .iter()
        .copied()
        .filter(|name| !name.is_empty())
        .collect();
    if let Some(name) = similar(unknown, known.iter().copied()) {
        return format!("unknown key or value '{unknown}': did you mean '{name}'?");
    }
    let tables = tables_with(unknown);
    let is_here = tables.iter().any(|table| named.starts_with(table));
    if !tables.is_empty() && !is_here {
        let tables = tables.join(" or ");
        return format!("unknown key '{unknown}' here: it belongs to {tables}");
    }
    if known.is_empty() {
        return format!("unknown key or value '{unknown}'");
    }
    let known = known.join("', '");
    if is_here {
        return format!("this kind has no key '{unknown}': known are '{known}'");
    }
    format!("unknown key or value '{unknown}': known are '{known}'")
}

/// The tables of a scene with a key of this name, as they begin in a file; if there is none, the tables within these.
fn tables_with(key: &str) -> Vec<String> {
    let schema = schema();
    let (mut tables, mut within) = (Vec::new(), Vec::new());
    for (table, part) in schema["properties"].as_object().into_iter().flatten() {
        let table = match part["type"] == "array" {
            true => format!("[[{table}]]"),
            false => format!("[{table}]"),
        };
        for (name, part) in keys_of(&schema, part) {
            if name == key {
                tables.push(table.clone());
            } else if keys_of(&schema, part).any(|(name, _)| name == key) {
                within.push(format!("'{name}' in {table}"));
            }
        }
    }
    let mut with_key = if tables.is_empty() { within } else { tables };
    // The schema's order depends on features of the JSON library.
    with_key.sort_unstable();
    with_key.dedup();
    with_key
}

/// The keys of all kinds of the table that a part of a schema refers to, with their parts; none if it refers to none.
fn keys_of<'a>(
    schema: &'a Value,
    part: &'a Value,
) -> impl Iterator<Item = (&'a String, &'a Value)> {
    let reference = [&part["items"]["$ref"], &part["allOf"][0]["$ref"]];
    let reference = reference.into_iter().find_map(Value::as_str);
    let name = reference.and_then(|reference| reference.rsplit('/').next());
    let of = name.map_or(&Value::Null, |name| &schema["definitions"][name]);
    let kinds = of["oneOf"].as_array().into_iter().flatten();
    std::iter::once(of)
        .chain(kinds)
        .filter_map(|of| of["properties"].as_object())
        .flatten()
}

/// What was wanted: `f64` and the like, or words already.
fn wanted_value(wanted: &str) -> String {
    let words = match wanted {
        // No integer of TOML is too large for 64 bits.
        "usize" | "u64" => "a whole number of at least 0",
        "u32" => "a whole number from 0 to 4294967295",
        "a nonzero u32" => "a whole number from 1 to 4294967295",
        "f32" | "f64" => "a number",
        "a boolean" => "true or false",
        "a sequence" => "a list",
        "a map" => "a table",
        "a string" | "variant identifier" => "text in quotes",
        "path string" => "a path in quotes",
        _ if wanted.starts_with("struct ") || wanted.ends_with(" enum") => "a table",
        _ => return wanted.replace("an array of length ", "a list of "),
    };
    words.to_owned()
}

/// What was given: ``integer `3` ``, `string "a"`, `map` and the like.
fn given_value(given: &str) -> String {
    match given {
        "sequence" => return "a list".to_owned(),
        "map" => return "a table".to_owned(),
        _ => {}
    }
    let kinds = ["integer ", "floating point ", "boolean ", "string "];
    let value = kinds.iter().find_map(|kind| given.strip_prefix(kind));
    match value {
        Some(value) => value.trim_end_matches(" as i128").replace('`', ""),
        None => given.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;

    fn message(text: &str) -> String {
        Scene::from_toml(text).unwrap_err().to_string()
    }

    /// Shapes and colliders name their kind by a key, regions are one.
    #[test]
    fn a_region_without_its_kind() {
        for region in [
            "{ kind = \"box\", low = [0, 0, 0], high = [1, 1, 1] }",
            "{}",
        ] {
            let given = message(&format!("[[body]]\nfixed = [{region}]"));
            assert!(
                given.starts_with("line 2: expected a table with one key"),
                "{given}"
            );
            let (_, example) = given.split_once("as in ").unwrap();
            Scene::from_toml(&format!("[[body]]\nfixed = [{example}]")).unwrap();
        }
    }

    #[test]
    fn wrong_types_are_named_as_in_a_scene() {
        let shape =
            |rest: &str| message(&format!("[[body]]\nshape = {{ kind = \"liver\", {rest} }}"));
        let whole = "line 2: expected a whole number of at least 0, found";
        assert_eq!(shape("tets = -5"), format!("{whole} -5"));
        assert_eq!(shape("tets = 0.5"), format!("{whole} 0.5"));
        assert_eq!(shape("tets = [4, 4]"), format!("{whole} a list"));
        let given = |text: &str| message(text).replace("line 2: ", "");
        let cases = [
            (
                "[world]\ngravity = -9.81",
                "expected a list of 3, found -9.81",
            ),
            (
                "[world]\ngravity = [0, 1]",
                "expected a list of 3, found a list of 2",
            ),
            ("[world]\nground = 0.0", "expected a table, found 0.0"),
            (
                "[cutting]\nimprove = \"yes\"",
                "expected true or false, found \"yes\"",
            ),
            (
                "[contact]\nfriction = true",
                "expected a number, found true",
            ),
            ("[[body]]\nmesh = 3", "expected a path in quotes, found 3"),
            ("[[body]]\nfixed = 3", "expected a list, found 3"),
            ("[[stroke]]\nkind = 3", "expected text in quotes, found 3"),
            (
                "[solver]\nsubsteps = \"many\"",
                "expected a number of substeps or \"auto\", found \"many\"",
            ),
            (
                "[solver]\nsubsteps = \"10\"",
                "expected a number of substeps or \"auto\", found \"10\"",
            ),
            (
                "[solver]\nsubsteps = 99999999999999999999",
                "expected a number of substeps or \"auto\", found 99999999999999999999",
            ),
        ];
        for (text, words) in cases {
            assert_eq!(given(text), words, "{text}");
        }
        let one = message("[body]\nmesh = \"a.msh\"");
        assert!(one.contains("as in [[body]]"), "{one}");
        assert_eq!(
            message("contact = true"),
            "line 1: expected a table, found true"
        );
        assert_eq!(
            message("[[stroke]]\nkind = \"plane\"\nframe = 1\npoint = [0, 0, 0]"),
            "line 1: the key 'normal' is missing"
        );
    }

    #[test]
    fn unknown_keys_name_the_nearest() {
        assert_eq!(
            message("[world]\ngravty = [0, 0, 0]"),
            "line 2: unknown key or value 'gravty': did you mean 'gravity'?"
        );
        assert!(message("[solver]\nmethod = \"gaus-seidel\"").contains("'gauss-seidel'"));
        assert!(message("[[stroke]]\nkind = \"plain\"").contains("'plane'"));
        assert!(message("[[body]]\nfixed = [{ halfspace = {} }]").contains("'half_space'"));
        assert!(
            message(
                "[[stroke]]\nkind = \"plane\"\nframe = 1\npoint=[0,0,0]\nnormal=[0,0,1]\nsnp=1"
            )
            .contains("'snap'")
        );
        assert!(message("[world\n").starts_with("line 1: "));
    }

    /// Tables with a kind are read as a whole; the line is still that of the key.
    #[test]
    fn a_key_that_a_kind_does_not_have_is_named_with_its_line() {
        let plane =
            "[[stroke]]\nkind = \"plane\"\nframe = 1\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n";
        for (more, words) in [
            (
                "snp = 1",
                "line 6: unknown key or value 'snp': did you mean 'snap'?",
            ),
            (
                "solid = {}",
                "line 6: this kind has no key 'solid': known are 'frame'",
            ),
            (
                "[[stroke]]\nkind = \"plane\"\n frame = 1\n  snp=1",
                "line 9: unknown key",
            ),
        ] {
            let said = message(&format!("{plane}{more}"));
            assert!(said.starts_with(words), "{said}");
        }
        let inline =
            message("[[body]]\nmesh = \"a.vtk\"\nshape = { kind = \"box\", tets = 9, size = 1 }");
        assert!(inline.starts_with("line 3: "), "{inline}");
    }

    #[test]
    fn without_a_similar_name_all_are_listed() {
        assert_eq!(
            message("[world.ground]\nfloor = 1"),
            "line 2: unknown key or value 'floor': known are 'height', 'friction'"
        );
        let of_body = message("[[body]]\ngenerate = 3");
        assert!(of_body.contains("known are 'mesh', 'shape'"), "{of_body}");
    }

    #[test]
    fn a_key_in_the_wrong_table_names_its_own() {
        for (text, key, own) in [
            ("gravity = [0, 0, -9.81]", "gravity", "[world]"),
            ("[ground]\nheight = 0", "ground", "[world]"),
            (
                "[world]\nquantities = [\"force\"]",
                "quantities",
                "[report]",
            ),
            (
                "[cutting]\nself_contact = true",
                "self_contact",
                "[contact]",
            ),
            (
                "[world]\nhalf_extents = [1, 1, 1]",
                "half_extents",
                "[[collider]]",
            ),
            (
                "[world]\nfriction = 1",
                "friction",
                "[[collider]] or [contact]",
            ),
            (
                "[[body]]\ntoughness = 20",
                "toughness",
                "'solid' in [[stroke]]",
            ),
        ] {
            let said = message(text);
            let expected = format!("unknown key '{key}' here: it belongs to {own}");
            assert!(said.ends_with(&expected), "{said}");
        }
    }

    #[test]
    fn a_key_that_is_there_twice_is_named() {
        for (text, key) in [
            ("[contact]\nfriction = 0.1\nfriction = 0.2", "friction"),
            ("[contact]\nfriction = 0.1\n[contact]", "contact"),
        ] {
            let said = message(text);
            assert_eq!(said, format!("line 3: the key '{key}' is there twice"));
        }
    }

    /// A list would be read as the values of the keys in their order.
    #[test]
    fn a_rotation_is_no_list() {
        let of = |rotation: &str| {
            let text = format!(
                "[[collider]]\nkind = \"box\"\ncenter = [0, 0, 0]\nhalf_extents = [1, 1, 1]\nrotation = {rotation}"
            );
            Scene::from_toml(&text)
        };
        for list in ["[0, 0.2, 0, 1]", "[0, 0, 90]", "[[0, 0, 1], 90]"] {
            let given = of(list).unwrap_err().to_string();
            assert!(
                given.ends_with("expected a table with axis and angle_degrees, found a list"),
                "{given}"
            );
        }
        of("{ axis = [0, 0, 1], angle_degrees = 90 }").unwrap();
        let given = of("{ axis = [0, 0, 1] }").unwrap_err().to_string();
        assert!(
            given.ends_with("the key 'angle_degrees' is missing"),
            "{given}"
        );
    }

    /// All that a table lacks is said at once.
    #[test]
    fn missing_keys_are_named_together() {
        for (table, keys) in [
            (
                "[[stroke]]\nkind = \"plane\"\nframe = 3",
                "the keys 'point', 'normal' are missing",
            ),
            (
                "[[stroke]]\nkind = \"sweep\"",
                "the keys 'frames', 'blade', 'path' are missing",
            ),
            (
                "[[stroke]]\nkind = \"sweep\"\nframes = [1, 2]\nblade = [[0, 0, 0], [0, 0, 1]]\npath = [[0, 0, 0], [1, 0, 0]]\n\
                 solid = { toughness = 3 }",
                "the keys 'thickness', 'wedge_angle_degrees', 'height' are missing",
            ),
            (
                "[[collider]]\nkind = \"box\"\nfriction = 1",
                "the keys 'center', 'half_extents' are missing",
            ),
            ("[[body]]\nshape = {}", "the key 'kind' is missing"),
            (
                "[[body]]\nshape = { kind = \"liver\" }",
                "the key 'tets' is missing",
            ),
            (
                "[world]\nground = { friction = 0.5 }",
                "the key 'height' is missing",
            ),
        ] {
            let said = message(table);
            assert!(said.ends_with(keys), "{table}: {said}");
        }
    }

    #[test]
    fn other_messages_stay() {
        for text in ["invalid basic string", "unknown", "invalid type: what"] {
            assert_eq!(in_scene_words(text, ""), text);
        }
    }
}
