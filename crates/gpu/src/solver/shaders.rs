//! Tests that shaders are valid and mean the same as the host: bindings in number and kind, and the layout of structures.

use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{AddressSpace, Module, StorageAccess, TypeInner};

use super::SOURCES;
use super::numbers::{Attachment, Part, ParticlePatch, Settings, TetPatch, Turn};
use crate::kernel::Use;

/// WebGPU's limit.
const STORAGE_BUFFERS: usize = 8;

fn modules() -> impl Iterator<Item = (&'static str, &'static [Use], Module)> {
    SOURCES.iter().map(|source| {
        let text = source.parts.concat();
        let module = naga::front::wgsl::parse_str(&text);
        let module =
            module.unwrap_or_else(|e| panic!("{}: {}", source.name, e.emit_to_string(&text)));
        (source.name, source.uses, module)
    })
}

#[test]
fn shaders_are_valid_and_use_what_the_host_binds() {
    for (name, uses, module) in modules() {
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        validator
            .validate(&module)
            .unwrap_or_else(|e| panic!("{name}: {e:?}"));
        let mut bound = 0;
        for (_, variable) in module.global_variables.iter() {
            let Some(binding) = variable.binding else {
                continue;
            };
            let usage = uses[binding.binding as usize];
            let fits = match variable.space {
                AddressSpace::Uniform => matches!(usage, Use::Uniform | Use::Part(_)),
                AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => {
                    usage == Use::Write
                }
                AddressSpace::Storage { .. } => usage == Use::Read,
                _ => false,
            };
            assert!(fits, "{name}, {:?}: {usage:?}", variable.name);
            bound += 1;
        }
        assert_eq!(bound, uses.len(), "{name}");
        let storage = uses.iter().filter(|u| matches!(u, Use::Read | Use::Write));
        assert!(storage.count() <= STORAGE_BUFFERS, "{name}");
    }
}

#[test]
fn structures_have_the_size_of_the_host() {
    let sizes = [
        ("Settings", size_of::<Settings>()),
        ("Part", size_of::<Part>()),
        ("Turn", size_of::<Turn>()),
        ("Attachment", size_of::<Attachment>()),
        ("Pose", size_of::<[[f32; 4]; 3]>()),
        ("TetPatch", size_of::<TetPatch>()),
        ("ParticlePatch", size_of::<ParticlePatch>()),
    ];
    let mut found = [false; 7];
    for (name, _, module) in modules() {
        for (_, of) in module.types.iter() {
            let TypeInner::Struct { span, .. } = of.inner else {
                continue;
            };
            let known = sizes
                .iter()
                .position(|(what, _)| Some(*what) == of.name.as_deref());
            if let Some(known) = known {
                found[known] = true;
                assert_eq!(span as usize, sizes[known].1, "{name}: {:?}", of.name);
            }
        }
    }
    assert_eq!(found, [true; 7]);
}
