//! Every kernel is read by compilers other than the driver's, and its structs are what the host thinks they are.

use std::path::PathBuf;
use std::process::Command;

use incise_gpu::{SharedStruct, shaders, shared_structs};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{Module, TypeInner};

fn parse(name: &str, source: &str) -> Module {
    naga::front::wgsl::parse_str(source)
        .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(source)))
}

/// The fields of a struct in a kernel and their offsets, if the kernel has that struct.
fn fields<'m>(module: &'m Module, name: &str) -> Option<Vec<(&'m str, usize)>> {
    let (_, of) = module
        .types
        .iter()
        .find(|(_, of)| of.name.as_deref() == Some(name))?;
    let TypeInner::Struct { members, .. } = &of.inner else {
        panic!("{name} is a struct on the host");
    };
    let field = |member: &'m naga::StructMember| {
        let name = member.name.as_deref().expect("members have names");
        (name, member.offset as usize)
    };
    Some(members.iter().map(field).collect())
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
            eprintln!("SKIPPED tint_accepts_every_shader: there is no tint");
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
    for SharedStruct {
        name,
        fields: expected,
        ..
    } in shared_structs()
    {
        let found: Vec<_> = modules
            .iter()
            .filter_map(|module| fields(module, name))
            .collect();
        assert!(!found.is_empty(), "no kernel has {name}");
        for fields in found {
            assert_eq!(fields, expected, "{name}");
        }
    }
}

#[test]
fn names_are_different() {
    let mut names: Vec<_> = shaders().iter().map(|shader| shader.name).collect();
    names.sort_unstable();
    assert!(names.windows(2).all(|pair| pair[0] != pair[1]));
}
