//! Compares the layouts, bindings and limits of the shaders, as assumed in Rust, with those found by naga.

use wgpu::naga::front::wgsl::parse_str;
use wgpu::naga::valid::{Capabilities, GlobalUse, ModuleInfo, ValidationFlags, Validator};
use wgpu::naga::{AddressSpace, ArraySize, Handle, Module, StorageAccess, Type, TypeInner};

use super::*;
use crate::kernels::{Binding, SOURCES, Source, slot};
use vrtm_core::allocation::Vec;

/// A kernel's module, validated without optional capabilities.
fn module(source: &Source) -> (Module, ModuleInfo) {
    let module = parse_str(&source.text(0))
        .unwrap_or_else(|error| panic!("{:?}: {}", source.kernel, error.emit_to_string(&source.text(0))));
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    let info = validator.validate(&module).unwrap_or_else(|error| panic!("{:?}: {error:?}", source.kernel));
    (module, info)
}

/// The number of words of a type, all of whose parts are words.
fn words(module: &Module, ty: Handle<Type>) -> usize {
    match &module.types[ty].inner {
        TypeInner::Scalar(scalar) | TypeInner::Atomic(scalar) if scalar.width == 4 => 1,
        TypeInner::Array { base, size: ArraySize::Constant(n), .. } => {
            n.get() as usize * words(module, *base)
        }
        TypeInner::Vector { size, scalar } if scalar.width == 4 => *size as usize,
        other => panic!("{other:?}"),
    }
}

/// The structs that both languages have, with their bytes.
const STRUCTS: [(&str, usize); 6] = [
    ("Params", size_of::<Params>()),
    ("Chart", size_of::<Chart>()),
    ("BlockRecord", size_of::<BlockRecord>()),
    ("Triangle", size_of::<Triangle>()),
    ("Request", size_of::<Request>()),
    ("RedirectRequest", size_of::<RedirectRequest>()),
];

/// The fields and their order are generated, and Rust's structs have no gaps, as `Pod` demands: if WGSL's have none
/// either, whose alignment has rules of its own, all fields are where Rust has them.
#[test]
fn generated_structs_are_laid_out_as_in_rust() {
    for source in &SOURCES {
        let (module, _) = module(source);
        for (name, size) in STRUCTS {
            let found = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name));
            let (_, ty) = found.unwrap_or_else(|| panic!("{name} is not in {:?}", source.kernel));
            let TypeInner::Struct { members, span } = &ty.inner else { panic!("{name} is no struct") };
            assert_eq!(*span as usize, size, "{name} in {:?}", source.kernel);
            let words: usize = members.iter().map(|member| words(&module, member.ty)).sum();
            assert_eq!(4 * words, size, "{name}");
        }
    }
}

/// The globals that a kernel's entry point uses: binding number, whether it is declared writable, and its use.
fn used(module: &Module, info: &ModuleInfo, source: &Source) -> Vec<(u32, bool, GlobalUse)> {
    let entry = module.entry_points.iter().position(|entry| entry.name == source.entry);
    let of_entry = info.get_entry_point(entry.unwrap_or_else(|| panic!("no entry {}", source.entry)));
    let mut all: Vec<_> = module
        .global_variables
        .iter()
        .filter_map(|(handle, variable)| {
            let binding = variable.binding.as_ref()?;
            assert_eq!(binding.group, 0);
            let written = match variable.space {
                AddressSpace::Storage { access } => access.contains(StorageAccess::STORE),
                _ => false,
            };
            let how = of_entry[handle];
            (!how.is_empty()).then_some((binding.binding, written, how))
        })
        .collect();
    all.sort_by_key(|(number, ..)| *number);
    all
}

#[test]
fn kernels_bind_what_they_use() {
    for source in &SOURCES {
        let (module, info) = module(source);
        let used = used(&module, &info, source);
        let name = format!("{:?}", source.kernel);
        for (number, written, _) in &used {
            let bound = source.bindings.iter().find(|b| b.number() == *number);
            let writes = match bound.unwrap_or_else(|| panic!("{name} uses binding {number}, which it lacks"))
            {
                Binding::Params | Binding::Read(_) => false,
                Binding::Write(_) => true,
            };
            assert_eq!(writes, *written, "{name}: access of binding {number}");
        }
        // Each kernel binds parameters and charts, and only those other buffers that it uses.
        let always = [Binding::Params.number(), slot::CHARTS];
        for binding in source.bindings {
            let number = binding.number();
            let is_used = used.iter().any(|(n, ..)| *n == number);
            assert!(is_used || always.contains(&number), "{name} binds {number}, but does not use it");
        }
    }
}

/// Pipelines do not zero workgroup memory. Software drivers happen to give zeros, hardware does not.
#[test]
fn workgroup_atomics_are_set_before_they_are_used() {
    let mut found = 0;
    for source in &SOURCES {
        let (module, _) = module(source);
        for (_, variable) in module.global_variables.iter() {
            let name = variable.name.as_deref().unwrap_or_default();
            let is_atomic = matches!(module.types[variable.ty].inner, TypeInner::Atomic(_));
            if variable.space == AddressSpace::WorkGroup && is_atomic {
                found += 1;
                assert!(
                    source.text(0).contains(&format!("atomicStore(&{name}, ")),
                    "{:?}: {name}",
                    source.kernel
                );
            }
        }
    }
    assert!(found > 0);
}

#[test]
fn webgpu_s_default_limits_suffice() {
    let limits = wgpu::Limits::defaults();
    for source in &SOURCES {
        let (module, info) = module(source);
        let name = format!("{:?}", source.kernel);
        let storage = source.bindings.iter().filter(|b| !matches!(b, Binding::Params)).count() as u32;
        assert!(storage <= limits.max_storage_buffers_per_shader_stage, "{name}: {storage} storage buffers");
        let index = module.entry_points.iter().position(|entry| entry.name == source.entry).unwrap();
        // Four nodes of a block for each thread, or one; or a line of nodes.
        let [threads, 1, 1] = module.entry_points[index].workgroup_size else { panic!("{name}") };
        let line = vrtm_core::grid::planes::SIDE as u32;
        assert!([THREADS, 4 * THREADS, line].contains(&threads), "{name}: {threads} threads");
        assert!(threads <= limits.max_compute_invocations_per_workgroup, "{name}: {threads} threads");
        let mut bytes = 0;
        for (handle, variable) in module.global_variables.iter() {
            let used = !info.get_entry_point(index)[handle].is_empty();
            if used && variable.space == AddressSpace::WorkGroup {
                // Each variable begins at a multiple of its alignment, which is at most 16.
                let size = module.types[variable.ty].inner.size(module.to_ctx());
                bytes += size.next_multiple_of(16);
            }
        }
        assert!(
            bytes <= limits.max_compute_workgroup_storage_size,
            "{name}: {bytes} bytes of workgroup memory"
        );
        println!(
            "{name:16} {storage} storage buffers, {threads:3} threads, {bytes:5} bytes of workgroup memory"
        );
    }
    assert!(size_of::<Params>() as u64 <= limits.max_uniform_buffer_binding_size);
}
