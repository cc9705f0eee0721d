//! The device that all tests of this process share.

use std::io::{Write, stderr};
use std::sync::OnceLock;

use incise_gpu::{GpuContext, GpuError, GpuOptions};

static CONTEXT: OnceLock<Result<GpuContext, GpuError>> = OnceLock::new();

/// The device, or `None` with a note on stderr on a machine without one.
pub(crate) fn gpu(test: &str) -> Option<&'static GpuContext> {
    match CONTEXT.get_or_init(|| GpuContext::new(&GpuOptions::from_env())) {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            let required = std::env::var_os("INCISE_REQUIRE_GPU").is_some();
            assert!(!required, "a GPU is required: {error}");
            skip(test, &error.to_string());
            None
        }
    }
}

/// Prints that a test is skipped. Not by `eprintln`, which is shown for tests that fail only.
pub(crate) fn skip(test: &str, why: &str) {
    let line = format!("SKIPPED {test}: {why}\n");
    stderr().write_all(line.as_bytes()).unwrap();
}
