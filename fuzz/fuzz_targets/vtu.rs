//! Any bytes as VTK XML files: an error or a mesh whose parts fit together.
#![no_main]


libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    incise_fuzz::check_mesh(incise_mesh_io::parse_file("a.vtu", bytes));
});
