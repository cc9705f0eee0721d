//! Tests of pictures and render scenes.
//!
//! Pictures are compared with stored ones, `tests/references/*.png`. `INCISE_BLESS=1 cargo test -p incise-render` draws
//! these again by software: look at them before they are committed. What needs an adapter skips without one, with a
//! line on stderr, unless `INCISE_REQUIRE_GPU` is set: then it fails. Mesa's lavapipe, which is a processor, will do.

#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

mod animation;
mod camera;
mod device;
mod pictures;
mod references;
mod render_scene;
mod shaders;
mod sheet;
mod support;
