//! Any bytes as Wavefront files: an error or a surface whose parts fit together.
#![no_main]

use incise_mesh::io;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    incise_fuzz::check_surface(io::parse_surface("a.obj", bytes));
});
