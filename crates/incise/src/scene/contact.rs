//! [`ContactSpec`]: what made of tets touches what.

use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Contact between bodies, between their pieces, and of a body with itself. Absent: bodies and pieces pass through each
/// other. Bodies that may touch are solved together, with the largest of their numbers of substeps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ContactSpec {
    /// Coefficient of friction.
    #[serde(default = "rough")]
    #[schemars(range(min = 0.0, max = 1e3))]
    pub friction: f64,
    /// Whether a body touches itself everywhere. If not, its pieces touch each other all the same, and the two sides of
    /// a cut until they have slid apart.
    #[serde(default = "yes")]
    pub self_contact: bool,
    /// Which bodies touch each other: `"all"`, or pairs of their numbers, counted from 0.
    #[serde(default)]
    pub pairs: ContactPairs,
    /// Time in which an existing overlap is resolved. New overlaps are prevented at once.
    #[serde(default = "quick")]
    #[schemars(extend("unit" = "s"), range(min = 0.0, max = 1e3))]
    pub recovery_time: f64,
    /// Distance kept between surfaces. Parts of a body that are closer at rest keep their distance at rest; the two
    /// sides of a cut keep none until they have slid apart.
    #[serde(default)]
    #[schemars(extend("unit" = "m"), range(min = 0.0, max = 1e9))]
    pub thickness: f64,
}

impl Default for ContactSpec {
    fn default() -> Self {
        Self {
            friction: rough(),
            self_contact: yes(),
            pairs: ContactPairs::All,
            recovery_time: quick(),
            thickness: 0.0,
        }
    }
}

fn rough() -> f64 {
    0.3
}
fn yes() -> bool {
    true
}
fn quick() -> f64 {
    0.02
}

/// Which bodies touch each other: in a scene `"all"`, or a list of pairs.
///
/// ```
/// use incise::{Scene, scene::ContactPairs};
///
/// let pairs = |text: &str| Scene::from_toml(text).map(|scene| scene.contact.map(|contact| contact.pairs));
/// assert_eq!(pairs("")?, None);
/// assert_eq!(pairs("[contact]")?, Some(ContactPairs::All));
/// assert_eq!(pairs("[contact]\npairs = [[0, 2]]")?, Some(ContactPairs::Only(vec![[0, 2]])));
/// # Ok::<(), incise::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ContactPairs {
    /// All pairs of bodies.
    #[default]
    All,
    /// These pairs of different bodies; the order within a pair does not matter.
    Only(Vec<[usize; 2]>),
}

impl JsonSchema for ContactPairs {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        "ContactPairs".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let body = json_schema!({ "type": "integer", "minimum": 0 });
        json_schema!({
            "anyOf": [
                { "const": "all" },
                { "type": "array", "items": { "type": "array", "items": body, "minItems": 2, "maxItems": 2 } },
            ],
        })
    }
}

impl Serialize for ContactPairs {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::All => serializer.serialize_str("all"),
            Self::Only(pairs) => pairs.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for ContactPairs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = ContactPairs;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("\"all\" or a list of pairs of bodies such as [[0, 1]]")
            }

            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<ContactPairs, E> {
                match name {
                    "all" => Ok(ContactPairs::All),
                    _ => Err(E::unknown_variant(name, &["all"])),
                }
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<ContactPairs, A::Error> {
                let mut pairs = Vec::new();
                while let Some(pair) = list.next_element()? {
                    pairs.push(pair);
                }
                Ok(ContactPairs::Only(pairs))
            }
        }
        deserializer.deserialize_any(Either)
    }
}
