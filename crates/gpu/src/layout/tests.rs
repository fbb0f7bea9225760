//! Compares the layouts, bindings and limits of the shaders, as assumed in Rust, with those found by naga.

use std::path::Path;
use std::process::{Command, Stdio};

use wgpu::naga::front::wgsl::parse_str;
use wgpu::naga::valid::{Capabilities, GlobalUse, ModuleInfo, ValidationFlags, Validator};
use wgpu::naga::{AddressSpace, ArraySize, Handle, Module, ScalarKind, StorageAccess, Type, TypeInner};

use super::*;
use crate::kernels::{Binding, Kernel, SOURCES, Source, slot};
use crate::redirect::RedirectRequest;
use vrtm_core::allocation::{Vec, vec};

/// A kernel's module, validated without optional capabilities.
fn module(source: &Source) -> (Module, ModuleInfo) {
    let module = parse_str(&source.text(0))
        .unwrap_or_else(|error| panic!("{:?}: {}", source.kernel, error.emit_to_string(&source.text(0))));
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    let info = validator.validate(&module).unwrap_or_else(|error| panic!("{:?}: {error:?}", source.kernel));
    (module, info)
}

/// The Rust name of a type; an atomic has the name of its content.
fn rust_name(module: &Module, ty: Handle<Type>) -> String {
    match &module.types[ty].inner {
        TypeInner::Scalar(scalar) | TypeInner::Atomic(scalar) => match scalar.kind {
            ScalarKind::Float => format!("f{}", 8 * scalar.width),
            ScalarKind::Uint => format!("u{}", 8 * scalar.width),
            other => panic!("{other:?}"),
        },
        TypeInner::Array { base, size: ArraySize::Constant(n), .. } => {
            format!("[{}; {n}]", rust_name(module, *base))
        }
        TypeInner::Vector { size, scalar } => format!("[f{}; {}]", 8 * scalar.width, *size as u8),
        other => panic!("{other:?}"),
    }
}

/// Name, offset and type of each field.
type Fields = Vec<(String, usize, String)>;

macro_rules! fields {
    ($struct:ident: $($field:ident)*) => {
        (
            stringify!($struct),
            size_of::<$struct>(),
            vec![$((stringify!($field), std::mem::offset_of!($struct, $field))),*],
        )
    };
}

/// A struct's name, its bytes, and the offsets of some of its fields.
type Offsets = (&'static str, usize, Vec<(&'static str, usize)>);

/// The Rust offsets of some of each struct's fields: WGSL's layout has its own alignment rules.
fn structs() -> [Offsets; 6] {
    [
        fields!(Params: first factor smoothing node_planes),
        fields!(Chart: solved fraction limit_rounds),
        fields!(BlockRecord: active_neighbours chart children length_shift weights),
        fields!(Triangle: barycentric neighbours chart pose),
        fields!(Request: count rows texels_per_step),
        fields!(RedirectRequest: width first step cells origin is_delta),
    ]
}

#[test]
fn generated_structs_are_laid_out_as_in_rust() {
    for source in &SOURCES {
        let (module, _) = module(source);
        for (name, size, expected) in structs() {
            let found = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name));
            let (_, ty) = found.unwrap_or_else(|| panic!("{name} is not in {:?}", source.kernel));
            let TypeInner::Struct { members, span } = &ty.inner else { panic!("{name} is no struct") };
            let field = |m: &wgpu::naga::StructMember| {
                (m.name.clone().unwrap_or_default(), m.offset as usize, rust_name(&module, m.ty))
            };
            let members: Fields = members.iter().map(field).collect();
            assert_eq!(*span as usize, size, "{name} in {:?}", source.kernel);
            for (field, offset) in expected {
                let there = members.iter().any(|(name, at, _)| name == field && *at == offset);
                assert!(there, "{name}.{field} is at {offset} in Rust: {members:?}");
            }
            // All fields are numbers of four bytes, without gaps.
            let bytes = |ty: &str| match ty.trim_matches(['[', ']']).split_once("; ") {
                Some((_, count)) => 4 * count.parse::<usize>().unwrap(),
                None => 4,
            };
            assert_eq!(members.iter().map(|(_, _, ty)| bytes(ty)).sum::<usize>(), size, "{name}");
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
        let threads = match source.kernel {
            // Four nodes for each thread, colour by colour, or one chart, triangle or texel.
            Kernel::RelaxChords
            | Kernel::RelaxMetrics
            | Kernel::RelaxChordsWide
            | Kernel::RelaxMetricsWide
            | Kernel::ProjectChords
            | Kernel::ProjectMetrics
            | Kernel::RegulariseChords
            | Kernel::RegulariseMetrics
            | Kernel::CopyState
            | Kernel::SamplesChords
            | Kernel::SamplesMetrics
            | Kernel::Certify
            | Kernel::FallBack
            | Kernel::Surface
            | Kernel::SelectCharts
            | Kernel::Gate
            | Kernel::Invert
            | Kernel::Redirect => THREADS,
            // One line of a block's nodes each.
            Kernel::Falloff => vrtm_core::grid::planes::SIDE as u32,
            // A node, or a quarter of one.
            _ => 4 * THREADS,
        };
        let size = module.entry_points[index].workgroup_size;
        assert_eq!(size, [threads, 1, 1], "{name}");
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

/// Checks the shaders with the programs `naga` and `tint`, if installed. They may be other versions, and tint is a
/// compiler other than wgpu's.
#[test]
fn other_compilers_take_the_shaders() {
    // Both programs validate their input; a build of tint without binary output can still write WGSL.
    let run = |program: &str, argument: &Path| {
        let format: &[&str] = if program == "tint" { &["--format", "wgsl"] } else { &[] };
        Command::new(program).args(format).arg(argument).stdin(Stdio::null()).output()
    };
    let programs: Vec<&str> =
        ["naga", "tint"].into_iter().filter(|program| run(program, "--help".as_ref()).is_ok()).collect();
    if programs.is_empty() {
        println!("skipped: neither naga nor tint is on the PATH");
        return;
    }
    let folder = std::env::temp_dir().join(format!("vrtm_shaders_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut failures = Vec::new();
    for source in &SOURCES {
        let file = folder.join(format!("{:?}.wgsl", source.kernel));
        std::fs::write(&file, source.text(0)).unwrap();
        for program in &programs {
            let output = run(program, &file).unwrap();
            if !output.status.success() {
                let text = String::from_utf8_lossy(&output.stderr).into_owned();
                failures.push(format!("{program}, {:?}: {text}", source.kernel));
            }
        }
    }
    let _ = std::fs::remove_dir_all(&folder);
    println!("{} kernels, checked by {}", SOURCES.len(), programs.join(" and "));
    assert!(failures.is_empty(), "\n{}", failures.join("\n"));
}
