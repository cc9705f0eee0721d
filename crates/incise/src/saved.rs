//! Serialization of state that derived code cannot handle.
//!
//! Settings leave out defaults, which only self-describing formats can read, so they are written as TOML inside any
//! other format.

/// A value as TOML text: `#[serde(with = "as_toml")]`.
pub(crate) mod as_toml {
    use serde::de::{DeserializeOwned, Error as _};
    use serde::ser::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<T: Serialize, S: Serializer>(
        value: &T,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let text = toml::to_string(value).map_err(S::Error::custom)?;
        text.serialize(serializer)
    }

    pub(crate) fn deserialize<'de, T: DeserializeOwned, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<T, D::Error> {
        let text = String::deserialize(deserializer)?;
        toml::from_str(&text).map_err(D::Error::custom)
    }
}
