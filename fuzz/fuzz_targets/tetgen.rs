//! TetGen's pairs of files: the bytes up to the first zero are the points, the rest the tets.
#![no_main]


libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut files = bytes.splitn(2, |&byte| byte == 0);
    let [nodes, tets] = [files.next(), files.next()].map(Option::unwrap_or_default);
    incise_fuzz::check_mesh(incise_mesh_io::parse_tetgen("a.node", nodes, tets));
});
