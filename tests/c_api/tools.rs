//! Shared by the tests that compile C: the built library, the system's compilers, and a folder for programs.

#![allow(dead_code)] // Each test program uses some of these items only.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use vrtm_testkit::long;

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

pub fn text(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// Compiles a C or C++ program or, with `-shared`, a library, with warnings as errors and further options. It is linked
/// to the library unless it loads the library itself.
#[cfg(any(unix, all(windows, target_env = "gnu")))] // The flags are those of gcc and clang.
pub fn build(source: &Path, name: &str, options: &[&str], linked: bool) -> PathBuf {
    let built = if name.contains('.') { scratch().join(name) } else { program(name) };
    let (language, standard) = match source.extension() {
        Some(extension) if extension == "cpp" => ("cpp", "-std=c++17"),
        _ => ("c", "-std=c11"),
    };
    let mut command = Command::new(compiler(language));
    command
        // Hosts are small: in a short run it is the compiler's time that counts.
        .args([standard, if long::long() { "-O1" } else { "-O0" }])
        .args(["-g", "-Wall", "-Wextra", "-pedantic", "-Werror", "-pthread"])
        // On Windows all code can be moved, and the compiler warns of being told so.
        .args(if cfg!(windows) { &[][..] } else { &["-fPIC"] })
        .args(options);
    for folder in ["include", "tests/host"] {
        command.arg("-I").arg(root().join(folder));
    }
    command.arg(root().join(source)).arg("-o").arg(&built);
    if linked {
        command.args(link_arguments());
    }
    command.args(system_libraries());
    let output = command.output().unwrap_or_else(|error| panic!("{:?}: {error}", compiler(language)));
    assert!(output.status.success(), "{command:?}:\n{}", text(&output));
    built
}

/// A program of `tests/host` that is linked to the library.
pub fn host(file: &str) -> PathBuf {
    let name = format!("host_{}", file.rsplit('/').next().unwrap().split('.').next().unwrap());
    build(&Path::new("tests/host").join(file), &name, &[], true)
}

/// The settings of the machine must not change what a program does.
pub fn without_settings(command: &mut Command) -> &mut Command {
    ["VRTM_DEVICE", "VRTM_THREADS", "VRTM_GPU_LIMITS"].iter().for_each(|name| _ = command.env_remove(name));
    // Without it, a layer of Mesa's Vulkan drivers prints a warning to stderr.
    command.env("XDG_RUNTIME_DIR", scratch())
}

/// Runs a program and prints its output.
pub fn run(program: &Path, arguments: &[&Path]) -> String {
    run_with(program, arguments, &[])
}

pub fn run_with(program: &Path, arguments: &[&Path], variables: &[(&str, &str)]) -> String {
    let output = without_settings(&mut Command::new(program))
        .args(arguments)
        .env("PATH", search_path())
        .envs(variables.iter().copied())
        .output()
        .unwrap_or_else(|error| panic!("{}: {error}", program.display()));
    let said = text(&output);
    println!("{said}");
    assert!(output.status.success(), "{}: {}\n{said}", program.display(), output.status);
    // The library itself prints nothing.
    assert!(output.stderr.is_empty(), "stderr: {}", String::from_utf8_lossy(&output.stderr));
    said
}

/// Each line of a host is a case that went well: the library itself prints nothing.
pub fn check_cases(said: &str, at_least: usize) {
    let cases = said.lines().filter(|line| line.starts_with("ok   ")).count();
    assert!(cases >= at_least, "only {cases} cases ran");
    let foreign = said.lines().find(|line| !line.starts_with("ok   ") && *line != "0 failed");
    assert!(foreign.is_none(), "it did not print {foreign:?}: the library must not either");
}
