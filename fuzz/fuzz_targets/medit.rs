//! Any bytes as Medit files, ASCII and binary: an error or a mesh whose parts fit together.
#![no_main]


libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    incise_fuzz::check_mesh(incise_mesh_io::parse_file("a.mesh", bytes));
});
