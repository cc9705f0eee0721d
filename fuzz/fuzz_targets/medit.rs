//! Any bytes as Medit files, ASCII and binary: an error or a mesh whose parts fit together.
#![no_main]

use incise_mesh::io;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    incise_fuzz::check_mesh(io::parse_file("a.mesh", bytes));
});
