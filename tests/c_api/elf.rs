//! What the shared library asks of a Linux machine, against what docs/hosts.md says: which libraries it loads, by which
//! name programs load it, and how old the C library may be. tests/c_api/header.rs has its exports.

#![cfg(all(target_os = "linux", target_env = "gnu", target_pointer_width = "64"))]

use std::ffi::{CStr, c_char};

use object::elf::{self, FileHeader64};
use object::read::elf::{Dyn, FileHeader, SectionTable};
use object::{Endianness, StringTable};

use crate::tools::{library, root};

type Header = FileHeader64<Endianness>;

/// Entries of a library that the loader reads.
struct Needs {
    soname: String,
    libraries: Vec<String>,
    /// The newest version of glibc that must be there.
    glibc: Version,
}

/// Major and minor version, which compare as such.
type Version = (u32, u32);

fn version(text: &str) -> Version {
    let mut numbers = text.split('.').map(|part| part.parse().unwrap());
    (numbers.next().unwrap(), numbers.next().unwrap())
}

fn text(strings: StringTable, offset: u32) -> String {
    String::from_utf8(strings.get(offset).unwrap().to_vec()).unwrap()
}

fn needs() -> Needs {
    let bytes = std::fs::read(library()).unwrap();
    let data = bytes.as_slice();
    let header = Header::parse(data).unwrap();
    let endian = header.endian().unwrap();
    let sections: SectionTable<Header> = header.sections(endian, data).unwrap();
    let mut needs = Needs { soname: String::new(), libraries: Vec::new(), glibc: (0, 0) };

    let (entries, link) = sections.dynamic(endian, data).unwrap().expect("a dynamic section");
    let strings = sections.strings(endian, data, link).unwrap();
    for entry in entries {
        match u32::try_from(entry.d_tag(endian)) {
            Ok(elf::DT_NEEDED) => needs.libraries.push(text(strings, entry.val32(endian).unwrap())),
            Ok(elf::DT_SONAME) => needs.soname = text(strings, entry.val32(endian).unwrap()),
            _ => {}
        }
    }

    let (mut libraries, link) = sections.gnu_verneed(endian, data).unwrap().expect("versions of symbols");
    let strings = sections.strings(endian, data, link).unwrap();
    while let Some((_, mut versions)) = libraries.next().unwrap() {
        while let Some(wanted) = versions.next().unwrap() {
            let name = text(strings, wanted.vna_name.get(endian));
            // The loader goes on without a version that is marked so: all that needs it is optional.
            let optional = wanted.vna_flags.get(endian) & elf::VER_FLG_WEAK != 0;
            if let Some(number) = name.strip_prefix("GLIBC_").filter(|_| !optional) {
                needs.glibc = needs.glibc.max(version(number));
            }
        }
    }
    needs
}

#[test]
fn programs_load_it_by_the_major_version() {
    assert_eq!(needs().soname, format!("libvrtm.so.{}", env!("CARGO_PKG_VERSION_MAJOR")));
}

#[test]
fn it_loads_the_c_library_and_the_unwinder_alone() {
    let libraries = needs().libraries;
    let of_the_c_library = |name: &str| {
        // The loader is a part of it; so are threads and dlopen, in files of their own before glibc 2.34.
        ["libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2"].contains(&name)
            || name.starts_with("ld-linux")
    };
    for name in &libraries {
        assert!(of_the_c_library(name) || name == "libgcc_s.so.1", "it loads {name}");
    }
    assert!(libraries.iter().any(|name| name == "libc.so.6"), "{libraries:?}");
}

/// It follows from the glibc that the library is linked with: functions that moved ask for the version they moved in.
#[test]
fn the_oldest_glibc_is_the_one_that_the_documents_state() {
    unsafe extern "C" {
        safe fn gnu_get_libc_version() -> *const c_char;
    }
    let document = std::fs::read_to_string(root().join("docs/hosts.md")).unwrap();
    // The first one is that of a library with the GPU backend, the second of one without.
    let which = if cfg!(feature = "gpu") { 1 } else { 2 };
    let stated = document.split("glibc ").nth(which).expect("docs/hosts.md states two versions of glibc");
    let stated = version(stated.split(|c: char| !c.is_ascii_digit() && c != '.').next().unwrap());
    // SAFETY: glibc's own version, a string that is always there.
    let here = version(unsafe { CStr::from_ptr(gnu_get_libc_version()) }.to_str().unwrap());
    let found = needs().glibc;
    assert!(found <= here, "no library needs a glibc ({found:?}) that is newer than the linker's ({here:?})");
    if here >= stated {
        assert_eq!(found, stated, "docs/hosts.md states glibc {stated:?}");
    } else {
        assert!(found < stated);
    }
}
