//! Contacts found on generated bodies against slow searches, while they are cut.

#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

mod ahead;
mod candidates;
mod edges;
mod fresh_pairs;
mod oracle;
#[cfg(feature = "serde")]
mod saved;
mod scenarios;
mod scene;
