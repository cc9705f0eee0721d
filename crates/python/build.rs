//! Link arguments of a library that Python's interpreter loads: on macOS its symbols are looked up when it is loaded.
//!
//! maturin passes them, too; this is for `cargo build --workspace`.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
