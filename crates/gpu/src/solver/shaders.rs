//! A test that the solver's shaders use the buffers that the host binds, in number and kind.

use naga::{AddressSpace, Module, StorageAccess};

use super::SOURCES;
use crate::kernel::BindingKind;

fn modules() -> impl Iterator<Item = (&'static str, &'static [BindingKind], Module)> {
    SOURCES.iter().map(|source| {
        let text = source.parts.concat();
        let module = naga::front::wgsl::parse_str(&text);
        let module =
            module.unwrap_or_else(|e| panic!("{}: {}", source.name, e.emit_to_string(&text)));
        (source.name, source.uses, module)
    })
}

#[test]
fn shaders_use_what_the_host_binds() {
    for (name, uses, module) in modules() {
        let mut bound = 0;
        for (_, variable) in module.global_variables.iter() {
            let Some(binding) = variable.binding else {
                continue;
            };
            let usage = uses[binding.binding as usize];
            let fits = match variable.space {
                AddressSpace::Uniform => {
                    matches!(usage, BindingKind::Uniform | BindingKind::DynamicUniform(_))
                }
                AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => {
                    usage == BindingKind::Write
                }
                AddressSpace::Storage { .. } => usage == BindingKind::Read,
                _ => false,
            };
            assert!(fits, "{name}, {:?}: {usage:?}", variable.name);
            bound += 1;
        }
        assert_eq!(bound, uses.len(), "{name}");
    }
}
