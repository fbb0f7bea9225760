//! Shared by the tests that compile C: the built library, the system's compilers, and a folder for programs.

#![allow(dead_code)] // Each test program uses some of these items only.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The repository.
pub fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// A folder for compiled programs.
pub fn scratch() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
}

/// The path of the library as a host links it. Cargo builds it, a dev-dependency, into the folder of this test, so that
/// it is never older than the test. (A copy in the folder above may be older: only `cargo build` renews that one.)
pub fn library() -> PathBuf {
    let name = format!("{}vrtm{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    let test = std::env::current_exe().unwrap();
    let path = test.parent().unwrap().join(name);
    assert!(path.is_file(), "{} is not there: it is built by `cargo test`", path.display());
    path
}

/// The library's folder, as a linker's `-rpath` wants it: with a link under the name by which programs load the
/// library, which capi/cdylib/build.rs writes into it.
#[cfg(unix)]
fn loader_folder() -> PathBuf {
    let library = library();
    let major = env!("CARGO_PKG_VERSION_MAJOR");
    let link = match std::env::consts::DLL_SUFFIX {
        ".dylib" => format!("libvrtm.{major}.dylib"),
        suffix => format!("libvrtm{suffix}.{major}"),
    };
    // It leads to a name, not to a file: another test's link is as good as this one.
    match std::os::unix::fs::symlink(library.file_name().unwrap(), library.with_file_name(link)) {
        Err(error) if error.kind() != std::io::ErrorKind::AlreadyExists => {
            panic!("{}: {error}", library.display())
        }
        _ => library.parent().unwrap().to_owned(),
    }
}

/// Arguments by which a linker finds the library, now and when the program starts. On Windows it links the import
/// library, and programs find the DLL by `PATH`: see [`search_path`].
pub fn link_arguments() -> Vec<OsString> {
    #[cfg(unix)]
    return vec![library().into(), format!("-Wl,-rpath,{}", loader_folder().display()).into()];
    #[cfg(not(unix))]
    vec![library().with_file_name("libvrtm.dll.a").into()]
}

/// Libraries of the system that hosts need. On Windows the compiler's own go into the programs.
pub fn system_libraries() -> &'static [&'static str] {
    if cfg!(windows) { &["-static", "-lm"] } else { &["-lm", "-ldl"] }
}

/// A program's file in the scratch folder.
pub fn program(name: &str) -> PathBuf {
    scratch().join(format!("{name}{}", std::env::consts::EXE_SUFFIX))
}

/// The variable PATH with the library's folder, where Windows looks for DLLs.
pub fn search_path() -> OsString {
    let before = std::env::var_os("PATH").unwrap_or_default();
    let folder = library().parent().unwrap().to_owned();
    std::env::join_paths([folder].into_iter().chain(std::env::split_paths(&before))).unwrap()
}

/// The system's compiler for "c" or "cpp"; CC and CXX override it.
pub fn compiler(language: &str) -> OsString {
    let (variable, default) = if language == "c" { ("CC", "cc") } else { ("CXX", "c++") };
    std::env::var_os(variable).unwrap_or_else(|| default.into())
}
