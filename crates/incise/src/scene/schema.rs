//! [`schema`]: the JSON Schema of scene files, made from the scene structs.
//!
//! Descriptions are the doc comments of the structs. Units are in the key `unit`, which validators ignore. TOML has no
//! null, so an optional key has the type of its value. Editors that know JSON Schema complete and check scenes with it.

use schemars::Schema;
use schemars::generate::SchemaSettings;
use schemars::transform::{RecursiveTransform, Transform};
use serde_json::Value;

use super::Scene;

/// The JSON Schema (draft 7) of a scene.
///
/// ```
/// let schema = incise::scene::schema();
/// let density = &schema["definitions"]["BodySpec"]["properties"]["density"];
/// assert_eq!(density["unit"], "kg/m³");
/// assert_eq!(density["default"], 1000.0);
/// ```
#[must_use]
pub fn schema() -> Value {
    let generator = SchemaSettings::draft07().into_generator();
    let mut schema = generator.into_root_schema_for::<Scene>();
    RecursiveTransform(without_null).transform(&mut schema);
    RecursiveTransform(without_example).transform(&mut schema);
    schema.to_value()
}

/// Removes the example from a description: it shows the struct in Rust, not the file.
fn without_example(schema: &mut Schema) {
    if let Some(Value::String(text)) = schema.get_mut("description")
        && let Some(end) = text.find("\n\n```")
    {
        text.truncate(end);
    }
}

/// Removes the alternative `null` from a schema.
fn without_null(schema: &mut Schema) {
    let Some(object) = schema.as_object_mut() else {
        return;
    };
    if let Some(Value::Array(types)) = object.get_mut("type") {
        types.retain(|name| name != "null");
        if let [name] = &types[..] {
            let name = name.clone();
            object.insert("type".to_owned(), name);
        }
    }
    if let Some(Value::Array(choices)) = object.get_mut("anyOf") {
        choices.retain(|choice| choice["type"] != "null");
        if let [choice] = &choices[..] {
            let choice = choice.clone();
            object.remove("anyOf");
            match choice {
                Value::Object(keys) if !keys.contains_key("$ref") => {
                    object.extend(keys);
                }
                // Validators of this draft ignore all keys beside a reference.
                choice => {
                    object.insert("allOf".to_owned(), Value::Array(vec![choice]));
                }
            }
        }
    }
    if object.get("default") == Some(&Value::Null) {
        object.remove("default");
    }
}
