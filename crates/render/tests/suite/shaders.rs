//! Every shader is read by a compiler other than the driver's.

#[cfg(feature = "gpu")]
#[test]
fn naga_accepts_every_shader() {
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    for shader in incise_render::shaders() {
        let (name, source) = (shader.name, &shader.source);
        let module = naga::front::wgsl::parse_str(source)
            .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(source)));
        // What WebGPU has by default and no more.
        Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .unwrap_or_else(|error| panic!("{name}: {error:?}"));
        let globals = module.global_variables.iter();
        let storage = globals
            .filter(|(_, of)| matches!(of.space, naga::AddressSpace::Storage { .. }))
            .count();
        assert!(
            storage <= 8,
            "{name}: {storage} storage buffers, and WebGPU grants 8"
        );
    }
}
