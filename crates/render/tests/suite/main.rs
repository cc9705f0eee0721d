//! Tests of pictures and of what they are made from.

#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

mod shaders;
