//! Every kernel is read by compilers other than the driver's, and its structs have the layout that the host assumes.

use std::path::PathBuf;
use std::process::Command;

use incise_gpu::{shaders, shared_structs};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{ArraySize, Module, TypeInner};

use crate::support::skip;

fn parse(name: &str, source: &str) -> Module {
    naga::front::wgsl::parse_str(source)
        .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(source)))
}

/// The fields of a struct in a kernel with their offsets, and its size; both without a list of any length at the end.
/// Nothing if the kernel has no such struct.
fn layout<'m>(module: &'m Module, name: &str) -> Option<(Vec<(&'m str, usize)>, usize)> {
    let (_, of) = module
        .types
        .iter()
        .find(|(_, of)| of.name.as_deref() == Some(name))?;
    let TypeInner::Struct { members, span } = &of.inner else {
        panic!("{name} is a struct on the host");
    };
    let (mut fields, mut size) = (Vec::new(), *span as usize);
    for member in members {
        let offset = member.offset as usize;
        if is_list(&module.types[member.ty].inner) {
            size = offset;
        } else {
            fields.push((member.name.as_deref().expect("members have names"), offset));
        }
    }
    Some((fields, size))
}

fn is_list(of: &TypeInner) -> bool {
    let TypeInner::Array { size, .. } = of else {
        return false;
    };
    *size == ArraySize::Dynamic
}

#[test]
fn naga_accepts_every_shader() {
    for shader in shaders() {
        let module = parse(shader.name, &shader.source);
        // What WebGPU has by default and no more.
        Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .unwrap_or_else(|error| panic!("{}: {error:?}", shader.name));
        let mut storage = 0;
        for (_, variable) in module.global_variables.iter() {
            storage += usize::from(matches!(variable.space, naga::AddressSpace::Storage { .. }));
        }
        assert!(
            storage <= 8,
            "{}: {storage} storage buffers, and WebGPU grants 8",
            shader.name
        );
        for entry in &module.entry_points {
            let threads: u32 = entry.workgroup_size.iter().product();
            assert!(threads <= 256, "{}: {threads} threads", shader.name);
        }
    }
}

/// Tint is the compiler of Chromium. It refuses barriers that not all threads reach, which naga does not.
#[test]
fn tint_accepts_every_shader() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    for shader in shaders() {
        let file = folder.join(format!("{}.wgsl", shader.name));
        std::fs::write(&file, &shader.source).expect("the folder for tests can be written to");
        let tint = Command::new("tint")
            .args(["--format", "wgsl", "-o"])
            .arg(folder.join("out.wgsl"))
            .arg(&file)
            .output();
        let Ok(output) = tint else {
            skip("tint_accepts_every_shader", "there is no tint");
            return;
        };
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{}: {message}", shader.name);
    }
}

#[test]
fn structs_are_the_same_on_host_and_device() {
    let modules: Vec<Module> = shaders()
        .iter()
        .map(|shader| parse(shader.name, &shader.source))
        .collect();
    for shared in shared_structs() {
        let name = shared.name;
        let mut found = 0;
        for (fields, size) in modules.iter().filter_map(|module| layout(module, name)) {
            found += 1;
            assert_eq!(size, shared.size, "{name}");
            if !shared.fields.is_empty() {
                assert_eq!(fields, shared.fields, "{name}");
            }
        }
        assert!(found > 0, "no kernel has {name}");
    }
}

#[test]
fn names_are_different() {
    let mut names: Vec<_> = shaders().iter().map(|shader| shader.name).collect();
    names.sort_unstable();
    assert!(names.windows(2).all(|pair| pair[0] != pair[1]));
}
