//! The device that all tests of this process share.

use std::sync::OnceLock;

use incise_gpu::{GpuContext, GpuError, GpuOptions};

static CONTEXT: OnceLock<Result<GpuContext, GpuError>> = OnceLock::new();

/// The device, or `None` on a machine without one, which is said.
pub(crate) fn gpu(test: &str) -> Option<&'static GpuContext> {
    match CONTEXT.get_or_init(|| GpuContext::new(&GpuOptions::from_env())) {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            let required = std::env::var_os("INCISE_REQUIRE_GPU").is_some();
            assert!(!required, "a GPU is required: {error}");
            eprintln!("SKIPPED {test}: {error}");
            None
        }
    }
}
