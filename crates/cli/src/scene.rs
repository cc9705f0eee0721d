//! `incise scene`: the keys of a scene file as a JSON Schema, as a reference page or as a commented scene; validation.
//!
//! Reference page and commented scene are generated from the schema, which is derived from the structs of
//! `incise::scene`.

use std::path::Path;

use incise::Simulation;
use incise::scene::schema;
use serde_json::Value;

use crate::args::SceneArguments;
use crate::failure::Failure;
use crate::print::{count, print};
use crate::run::{load, located, print_warning};

pub(crate) fn scene(arguments: &SceneArguments) -> Result<(), Failure> {
    if let Some(path) = &arguments.check {
        return check(path);
    }
    let schema = schema();
    if arguments.schema {
        print(format!("{schema:#}"))
    } else if arguments.reference {
        print(reference(&schema).trim_end())
    } else {
        print(defaults(&schema).trim_end())
    }
}

/// Reads a scene and simulates its first frame, which finds every error and every warning that `incise run` would find at
/// its start.
fn check(path: &Path) -> Result<(), Failure> {
    let scene = load(Some(path))?;
    let in_file = |error| located(error, Some(path));
    let mut simulation = Simulation::new(&scene).map_err(in_file)?;
    for warning in simulation.step().map_err(in_file)?.warnings() {
        print_warning(warning);
    }
    let bodies = count(scene.body.len(), "body", "bodies");
    let tets = count(simulation.report().tets, "tet", "tets");
    let strokes = count(scene.stroke.len(), "stroke", "strokes");
    print(format!(
        "{}: valid: {bodies}, {tets}, {strokes}",
        path.display()
    ))
}

/// A key of a table.
struct Key<'a> {
    name: &'a str,
    schema: &'a Value,
    is_required: bool,
}

/// The keys of a table, in the order of the struct.
fn keys(table: &Value) -> Vec<Key<'_>> {
    let required = table["required"].as_array();
    let is_required = |name: &str| required.is_some_and(|names| names.iter().any(|n| n == name));
    let properties = table["properties"].as_object();
    let keys = properties.into_iter().flatten();
    keys.map(|(name, schema)| Key {
        name,
        schema,
        is_required: is_required(name),
    })
    .collect()
}

/// Name of the definition that a schema refers to.
fn referred(schema: &Value) -> Option<&str> {
    let reference = schema["$ref"].as_str();
    let reference = reference.or_else(|| schema["allOf"][0]["$ref"].as_str());
    reference?.rsplit('/').next()
}

/// Title of a type on the page.
fn title(name: &str) -> &str {
    name.trim_end_matches("Spec")
}

/// The first paragraph of the description of a schema.
fn description(schema: &Value) -> String {
    let text = text(schema, "description");
    text.split("\n\n").next().unwrap_or("").replace('\n', " ")
}

/// Text of a key of the schema; empty if absent.
fn text<'a>(schema: &'a Value, key: &str) -> &'a str {
    schema[key].as_str().unwrap_or("")
}

/// Named strings that a schema allows, with their descriptions; `None` for other schemas.
fn names(schema: &Value) -> Option<Vec<(&str, &str)>> {
    if let Some(names) = schema["enum"].as_array() {
        return names
            .iter()
            .map(|name| Some((name.as_str()?, "")))
            .collect();
    }
    let choices = schema["oneOf"].as_array()?.iter();
    choices
        .map(|choice| Some((choice["const"].as_str()?, text(choice, "description"))))
        .collect()
}

/// Formats a value as TOML.
fn toml(value: &Value) -> String {
    match value {
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(toml).collect();
            format!("[{}]", items.join(", "))
        }
        Value::String(text) if text == "inf" => text.clone(),
        Value::Number(number) => match number.as_f64() {
            Some(x) if number.is_f64() && (x.abs() >= 1e5 || (x != 0.0 && x.abs() < 1e-3)) => {
                format!("{x:e}")
            }
            _ => number.to_string(),
        },
        other => other.to_string(),
    }
}

/// The range of a number, such as `> 0, ≤ 2`; empty if all numbers of its type are allowed.
fn range(schema: &Value) -> String {
    let limits = [
        ("exclusiveMinimum", ">"),
        ("minimum", "≥"),
        ("exclusiveMaximum", "<"),
        ("maximum", "≤"),
    ];
    let limit = |(key, sign): (&str, &str)| {
        let value = schema[key].as_f64()?;
        let is_of_type = schema["type"] == "integer"
            && (value == 0.0 || value == f64::from(u32::MAX) || value == f64::from(u16::MAX));
        let is_plain = value == 0.0 || (1e-3..1e5).contains(&value.abs());
        let number = if is_plain {
            value.to_string()
        } else {
            format!("{value:e}")
        };
        (!is_of_type).then(|| format!("{sign} {number}"))
    };
    let limits: Vec<String> = limits.into_iter().filter_map(limit).collect();
    limits.join(", ")
}

/// Type of a value in words.
fn kind(schema: &Value, definitions: &Value) -> String {
    if let Some(name) = referred(schema) {
        let definition = &definitions[name];
        return match names(definition) {
            Some(_) => kind(definition, definitions),
            None if definition["anyOf"].is_array() => kind(definition, definitions),
            None => format!("[{}](#{})", title(name), title(name).to_lowercase()),
        };
    }
    if let Some(names) = names(schema) {
        let names: Vec<String> = names.iter().map(|(n, _)| format!("`\"{n}\"`")).collect();
        return names.join(", ");
    }
    if let Some(choices) = schema["anyOf"].as_array() {
        let choices: Vec<String> = choices.iter().map(|c| kind(c, definitions)).collect();
        return choices.join(" or ");
    }
    if let Some(name) = schema["const"].as_str() {
        return format!("`\"{name}\"`");
    }
    match text(schema, "type") {
        "array" => {
            let item = kind(&schema["items"], definitions);
            let count = &schema["minItems"];
            if *count == schema["maxItems"] && count.is_u64() {
                format!("{count} x {item}")
            } else {
                format!("list of {item}")
            }
        }
        "boolean" => "`true` or `false`".to_owned(),
        other => other.to_owned(),
    }
}

/// Default of a key as TOML, `required` or `-`.
fn default(key: &Key<'_>) -> String {
    match &key.schema["default"] {
        Value::Null if key.is_required => "required".to_owned(),
        // An array of tables, or a table with its own defaults.
        Value::Null | Value::Object(_) => "-".to_owned(),
        Value::Array(items) if items.is_empty() => "-".to_owned(),
        value => format!("`{}`", toml(value)),
    }
}

/// Escapes text for a table cell.
fn cell(text: &str) -> String {
    let text = text.replace('\n', " ").replace('|', "\\|");
    // Links to library items do not work on the page.
    let text = text.replace("[`Algorithm`](incise_coloring::Algorithm)", "algorithm");
    if text.is_empty() {
        "-".to_owned()
    } else {
        text
    }
}

/// Appends the table of the given keys.
fn table(page: &mut String, keys: &[Key<'_>], definitions: &Value) {
    page.push_str("| key | type | unit | range | default | meaning |\n|---|---|---|---|---|---|\n");
    for key in keys {
        let row = [
            format!("`{}`", key.name),
            kind(key.schema, definitions),
            cell(text(key.schema, "unit")),
            cell(&range(key.schema)),
            default(key),
            cell(text(key.schema, "description")),
        ];
        page.push_str(&format!("| {} |\n", row.join(" | ")));
    }
}

/// Appends a table or enumeration under its heading.
fn section(page: &mut String, heading: &str, schema: &Value, definitions: &Value) {
    page.push_str(&format!("\n## {heading}\n\n{}\n\n", description(schema)));
    let Some(choices) = schema["oneOf"].as_array() else {
        return table(page, &keys(schema), definitions);
    };
    for choice in choices {
        let keys = keys(choice);
        let description = text(choice, "description");
        if let Some(kind) = choice["properties"]["kind"]["const"].as_str() {
            page.push_str(&format!("**`kind = \"{kind}\"`**: {description}\n\n"));
            let keys: Vec<Key<'_>> = keys.into_iter().filter(|key| key.name != "kind").collect();
            table(page, &keys, definitions);
        } else if let [key] = &keys[..] {
            // A single key names the choice.
            page.push_str(&format!("**`{}`**: {description}\n\n", key.name));
            match key.schema["properties"].is_object() {
                true => table(page, &self::keys(key.schema), definitions),
                false => page.push_str(&format!("A {}.\n", kind(key.schema, definitions))),
            }
        }
        page.push('\n');
    }
    page.truncate(page.trim_end().len());
    page.push('\n');
}

/// A table of a scene file.
struct Table<'a> {
    name: &'a str,
    definition: &'a str,
    /// True for an array of tables.
    is_list: bool,
    /// True if the presence of the table has a meaning.
    is_optional: bool,
}

/// The tables of a scene file.
fn tables(schema: &Value) -> Vec<Table<'_>> {
    let tables = keys(schema).into_iter();
    tables
        .filter_map(|key| {
            let is_list = key.schema["items"].is_object();
            let item = if is_list {
                &key.schema["items"]
            } else {
                key.schema
            };
            Some(Table {
                name: key.name,
                definition: referred(item)?,
                is_list,
                is_optional: key.schema["optional"] == true,
            })
        })
        .collect()
}

/// Generates the reference page in Markdown.
fn reference(schema: &Value) -> String {
    let definitions = &schema["definitions"];
    let mut page = String::from(
        "# Scene files\n\nA scene is a TOML file. Absent keys have their defaults, features that a scene does not name cost \
        nothing, and an unknown key is an error that names the nearest known one. This page is the output of \
        `incise scene --reference`; `incise scene --schema` prints the JSON Schema for editors, `incise scene --defaults` a \
        commented scene with every default, and `incise scene --check FILE` validates a scene.\n",
    );
    let tables = tables(schema);
    for table in &tables {
        let (name, definition) = (table.name, table.definition);
        let heading = if table.is_list {
            format!("`[[{name}]]`")
        } else {
            format!("`[{name}]`")
        };
        section(&mut page, &heading, &definitions[definition], definitions);
    }
    page.push_str("\n# Types\n");
    for (name, definition) in definitions.as_object().into_iter().flatten() {
        let is_table = tables.iter().any(|table| table.definition == name);
        if is_table || definition["anyOf"].is_array() {
            continue;
        }
        match names(definition) {
            None => section(&mut page, title(name), definition, definitions),
            Some(choices) => {
                let description = text(definition, "description").replace('\n', " ");
                page.push_str(&format!(
                    "\n## {name}\n\n{description}\n\n| value | meaning |\n|---|---|\n"
                ));
                for (choice, meaning) in choices {
                    page.push_str(&format!("| `\"{choice}\"` | {} |\n", cell(meaning)));
                }
            }
        }
    }
    page
}

/// Line width of the commented scene.
const WIDTH: usize = 110;

/// Appends text as comment lines, wrapped at words.
fn comment(scene: &mut String, text: &str) {
    let mut line = String::from("#");
    for word in text.split_whitespace() {
        if line.len() + word.len() + 1 > WIDTH {
            scene.push_str(&line);
            line = String::from("\n#");
        }
        line.push(' ');
        line.push_str(word);
    }
    scene.push_str(&line);
    scene.push('\n');
}

/// Appends the keys of a table, each with a comment; those without a default are comments.
fn assignments(scene: &mut String, keys: &[Key<'_>], definitions: &Value, is_used: bool) {
    for key in keys {
        let description = cell(text(key.schema, "description"));
        let mut facts = vec![plain(&kind(key.schema, definitions))];
        facts.extend([text(key.schema, "unit").to_owned(), range(key.schema)]);
        if key.is_required {
            facts.push("required".to_owned());
        }
        facts.retain(|fact| !fact.is_empty());
        comment(scene, &format!("{description} ({})", facts.join("; ")));
        match &key.schema["default"] {
            Value::Null | Value::Object(_) => scene.push_str(&format!("# {} =\n", key.name)),
            value => {
                let mark = if is_used { "" } else { "# " };
                scene.push_str(&format!("{mark}{} = {}\n", key.name, toml(value)));
            }
        }
    }
}

/// Removes Markdown markup from a type.
fn plain(kind: &str) -> String {
    let names = kind.replace('`', "");
    match names.split_once("](#") {
        Some((before, _)) => before.replace('[', ""),
        None => names,
    }
}

/// Generates a scene with every key, its meaning and its default. It is runnable: the body is a generated beam.
fn defaults(schema: &Value) -> String {
    let definitions = &schema["definitions"];
    let mut scene = String::from(
        "# Every key of a scene with its default. Keys without a default and optional tables are comments.\n\
         # Regions, shapes and rotations are described by: incise scene --reference\n",
    );
    for table in tables(schema) {
        let (name, is_list) = (table.name, table.is_list);
        let definition = &definitions[table.definition];
        let is_body = name == "body";
        let is_used = (!is_list && !table.is_optional) || is_body;
        let mark = if is_used { "" } else { "# " };
        let heading = if is_list {
            format!("[[{name}]]")
        } else {
            format!("[{name}]")
        };
        let variants = definition["oneOf"].as_array();
        for table in variants.map_or(std::slice::from_ref(definition), |v| &v[..]) {
            let kind = table["properties"]["kind"]["const"].as_str();
            let described = if kind.is_some() { table } else { definition };
            scene.push('\n');
            comment(&mut scene, &description(described));
            scene.push_str(&format!("{mark}{heading}\n"));
            if let Some(kind) = kind {
                scene.push_str(&format!("{mark}kind = \"{kind}\"\n"));
            }
            let keys: Vec<Key<'_>> = keys(table)
                .into_iter()
                .filter(|k| k.name != "kind")
                .collect();
            assignments(&mut scene, &keys, definitions, is_used);
            if is_body {
                scene.push_str("shape = { kind = \"beam\", tets = 1000 }\n");
            }
        }
    }
    scene
}
