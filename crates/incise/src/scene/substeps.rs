//! [`Substeps`]: number of substeps of a frame.

use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::names::similar;

/// Number of substeps of a frame: in a scene a number, or `"auto"`.
///
/// ```
/// use incise::{Scene, scene::Substeps};
///
/// let scene = Scene::from_toml("[solver]\nsubsteps = \"auto\"\nmax_substeps = 50")?;
/// assert_eq!(scene.solver.substeps, Substeps::Auto);
/// assert_eq!(Scene::from_toml("[solver]\nsubsteps = 20")?.solver.substeps, 20.into());
/// # Ok::<(), incise::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Substeps {
    /// A fixed number, at least 1.
    Fixed(u32),
    /// Chosen for each body: the fewest substeps that reach the accuracy wanted, except for a few slivers, and at most
    /// `max_substeps`. The number rises, at most to twice itself, when cuts leave more than 1% of the volume outside
    /// the accuracy.
    Auto,
}

impl JsonSchema for Substeps {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Substeps".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "anyOf": [
                { "type": "integer", "minimum": 1, "maximum": u32::MAX },
                { "const": "auto" },
            ],
        })
    }
}

impl From<u32> for Substeps {
    fn from(substeps: u32) -> Self {
        Self::Fixed(substeps)
    }
}

impl Serialize for Substeps {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Fixed(substeps) => serializer.serialize_u32(*substeps),
            Self::Auto => serializer.serialize_str("auto"),
        }
    }
}

impl<'de> Deserialize<'de> for Substeps {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl Visitor<'_> for Either {
            type Value = Substeps;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number of substeps or \"auto\"")
            }

            fn visit_i64<E: serde::de::Error>(self, number: i64) -> Result<Substeps, E> {
                let number = u32::try_from(number)
                    .map_err(|_| E::invalid_value(Unexpected::Signed(number), &self))?;
                Ok(Substeps::Fixed(number))
            }

            fn visit_u64<E: serde::de::Error>(self, number: u64) -> Result<Substeps, E> {
                let number = u32::try_from(number)
                    .map_err(|_| E::invalid_value(Unexpected::Unsigned(number), &self))?;
                Ok(Substeps::Fixed(number))
            }

            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Substeps, E> {
                match name {
                    "auto" => Ok(Substeps::Auto),
                    _ if similar(name, ["auto"]).is_some() => {
                        Err(E::unknown_variant(name, &["auto"]))
                    }
                    _ => Err(E::invalid_value(Unexpected::Str(name), &self)),
                }
            }
        }
        deserializer.deserialize_any(Either)
    }
}
