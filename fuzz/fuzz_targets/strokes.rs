//! Strokes on small bodies, with every invariant checked after each.
//!
//! The program reader and the checks are those of the cutting crate's own tests, so what is found here can be put there
//! as bytes.
#![no_main]

#[path = "../../crates/cutting/tests/suite/bodies.rs"]
#[allow(dead_code, clippy::unwrap_used, reason = "shared with tests that use more of it")]
mod bodies;
#[path = "../../crates/cutting/tests/suite/programs.rs"]
#[allow(clippy::unwrap_used, reason = "a broken invariant must stop the fuzzer")]
mod programs;

libfuzzer_sys::fuzz_target!(|program: &[u8]| programs::run(program));
