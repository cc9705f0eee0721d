//! Any bytes as glTF files, binary or text: an error or a surface whose parts fit together.
#![no_main]


libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    incise_fuzz::check_surface(incise_mesh_io::parse_surface("a.glb", bytes));
});
