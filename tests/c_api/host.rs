//! Runs the library inside C and C++ hosts that are compiled with the system's compilers and linked to the built
//! library. Each host prints a line per case; a FAIL or a bad exit code fails the test.

// The hosts use POSIX threads, and the compiler's flags are those of gcc and clang: on Windows, MinGW-w64's.
#![cfg(any(unix, all(windows, target_env = "gnu")))]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::tools::{
    compiler, library, link_arguments, program, root, scratch, search_path, system_libraries,
};
use vrtm_testkit::{gpu, long};

fn text(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// Hosts are small: in a short run it is the compiler's time that counts.
fn optimisation() -> &'static str {
    if long::long() { "-O1" } else { "-O0" }
}

/// Compiles `source` with warnings as errors, and links it to the library unless it loads the library itself.
fn build(source: &Path, linked: bool) -> PathBuf {
    let name = source.file_stem().unwrap().to_string_lossy().into_owned();
    let program = program(&format!("host_{name}"));
    let (language, standard) = match source.extension() {
        Some(extension) if extension == "cpp" => ("cpp", "-std=c++17"),
        _ => ("c", "-std=c11"),
    };
    let mut command = Command::new(compiler(language));
    command
        .args([standard, optimisation(), "-g", "-Wall", "-Wextra", "-pedantic", "-Werror", "-pthread"])
        .arg("-I")
        .arg(root().join("include"))
        .arg("-I")
        .arg(root().join("tests/host"))
        .arg(source)
        .arg("-o")
        .arg(&program);
    if linked {
        command.args(link_arguments());
    }
    command.args(system_libraries());
    let output = command.output().unwrap_or_else(|error| panic!("{:?}: {error}", compiler(language)));
    assert!(output.status.success(), "{command:?}:\n{}", text(&output));
    program
}

/// Runs a program and prints its output. The settings of the machine must not change what it does.
fn run(program: &Path, arguments: &[&Path]) -> String {
    run_with(program, arguments, &[])
}

fn run_with(program: &Path, arguments: &[&Path], variables: &[(&str, &str)]) -> String {
    let output = Command::new(program)
        .args(arguments)
        .env_remove("VRTM_DEVICE")
        .env_remove("VRTM_THREADS")
        .env_remove("VRTM_GPU_LIMITS")
        // Without it, a layer of Mesa's Vulkan drivers prints a warning to stderr.
        .env("XDG_RUNTIME_DIR", scratch())
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

fn run_host(file: &str, at_least: usize) {
    run_host_with(file, &[], at_least);
}

fn run_host_with(file: &str, arguments: &[&Path], at_least: usize) {
    let program = build(&root().join("tests/host").join(file), true);
    let said = run(&program, arguments);
    let foreign = said.lines().find(|line| !line.starts_with("ok   ") && *line != "0 failed");
    assert!(foreign.is_none(), "{file} did not print {foreign:?}: the library must not either");
    let cases = said.lines().count() - 1;
    assert!(cases >= at_least, "{file}: only {cases} cases ran");
}

#[test]
fn smoke() {
    run_host("smoke.c", 50);
}

#[test]
fn misuse() {
    run_host("misuse.c", 150);
}

#[test]
fn mesh() {
    run_host("mesh.c", 50);
}

#[test]
fn layers() {
    run_host("layers.c", 40);
}

#[test]
fn float_mode() {
    run_host("float_mode.c", 30);
}

#[test]
#[cfg(any(target_os = "linux", windows))] // It counts the process's threads, as the system tells them.
fn jobs() {
    run_host("job.c", 90);
}

#[test]
fn jobs_on_a_host_s_threads() {
    run_host("job_threads.c", 35);
}

#[test]
fn refinements() {
    run_host("refine.c", 60);
}

#[test]
fn carriers() {
    run_host("carry.c", 45);
}

#[test]
fn deformer() {
    run_host("deformer.cpp", 15);
}

#[test]
fn a_c_host_estimates_saves_and_repaints_tiles() {
    run_host("prepare.c", 50);
}

#[test]
fn a_host_fetches_all_kinds_of_maps() {
    run_host("maps.c", 37);
}

#[test]
#[cfg(any(target_os = "linux", windows))]
fn memory_goes_back_after_the_last_asset() {
    let rounds = long::cases(2, 1, "rounds").to_string();
    run_host_with("memory.c", &[Path::new(&rounds)], 25);
}

#[test]
#[cfg(any(target_os = "linux", windows))]
fn ten_thousand_solves_leave_nothing_behind() {
    let solves = long::cases(10_000, 2000, "solves").to_string();
    run_host_with("soak.c", &[Path::new(&solves)], 15);
}

#[test]
#[cfg(unix)]
fn forks_signals_and_small_stacks_do_no_harm() {
    run_host("process.c", 30);
}

#[test]
#[cfg(target_os = "linux")]
fn a_locale_with_decimal_commas_changes_nothing() {
    let folder = scratch().join("locales");
    std::fs::create_dir_all(&folder).unwrap();
    let made = Command::new("localedef")
        .args(["-i", "de_DE", "-f", "UTF-8"])
        .arg(folder.join("de_DE.UTF-8"))
        .output()
        .is_ok_and(|output| output.status.success());
    if !made {
        println!("skipped: localedef does not make the locale de_DE");
        return;
    }
    let program = build(&root().join("tests/host/locale.c"), true);
    let said = run_with(&program, &[Path::new("de_DE.UTF-8")], &[("LOCPATH", folder.to_str().unwrap())]);
    assert!(said.lines().filter(|line| line.starts_with("ok   ")).count() >= 25, "{said}");
}

/// The header says which stack a caller needs.
#[test]
fn a_stack_of_48_kib_is_enough_on_the_cpu() {
    run_host("stack.c", 6);
}

/// Number of allocations, evenly spaced, at which a step of a host's work fails for want of memory.
/// VRTM_ALLOCATE_ROUNDS sets another number; 0 lets each allocation fail in turn.
fn rounds(all: u64, few: u64) -> PathBuf {
    let rounds = || long::cases(all, few, "allocations of each step that fail").to_string().into();
    std::env::var_os("VRTM_ALLOCATE_ROUNDS").unwrap_or_else(rounds).into()
}

fn run_allocate(program: &Path, way: &str, rounds: &Path) {
    let said = run(program, &[Path::new(way), rounds]);
    let foreign = said.lines().find(|line| !line.starts_with("ok   ") && *line != "0 failed");
    assert!(foreign.is_none(), "it did not print {foreign:?}: the library must not either");
}

#[test]
fn allocations_of_a_host_s_allocator_fail() {
    let program = build(&root().join("tests/host/allocate.c"), true);
    run_allocate(&program, "cpu", &rounds(8, 1));
    if gpu::has_gpu() && long::only("failures on a GPU") {
        run_allocate(&program, "gpu", &rounds(2, 1));
    }
}

/// In a process whose memory is short, with nothing of vrtm's help.
#[test]
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn allocations_of_the_system_fail() {
    let program = build(&root().join("tests/host/allocate_outside.c"), true);
    run_allocate(&program, "interposed", &rounds(4, 1));
    if long::only("limits of address space") {
        run_allocate(&program, "limited", Path::new("0"));
    }
}

#[test]
fn unload() {
    let program = build(&root().join("tests/host/unload.c"), false);
    let said = run(&program, &[&library()]);
    assert!(said.lines().filter(|line| line.starts_with("ok   ")).count() >= 24);
}

/// As in a session in which a plug-in is worked on: nothing that a process has few of is lost.
#[test]
fn a_thousand_loads() {
    let rounds = long::cases(1000, 300, "loads").to_string();
    let program = build(&root().join("tests/host/reload.c"), false);
    let said = run(&program, &[&library(), Path::new(&rounds)]);
    assert_eq!(said.lines().filter(|line| line.starts_with("ok   ")).count(), 8);
}

/// A list of hashes, which tests/targets/run.sh compares with those of other systems and processors.
#[test]
fn bits_for_other_targets() {
    let program = build(&root().join("tests/host/bits.c"), true);
    let hashes = [1, 3].map(|threads| run(&program, &[Path::new(&threads.to_string())]));
    assert!(hashes[0].lines().count() >= 22, "{}", hashes[0]);
    assert_eq!(hashes[0], hashes[1], "the number of threads changes the bits");
}

/// The hosts run with default options on a GPU as well, and unload the library afterwards.
#[test]
fn hosts_on_a_gpu() {
    if !gpu::has_gpu() {
        return;
    }
    for (file, linked, at_least) in [("smoke.c", true, 50), ("misuse.c", true, 150), ("unload.c", false, 18)]
    {
        // A program of its own, because the plain run may be building the same source at this time.
        let source = scratch().join(format!("gpu_{file}"));
        std::fs::copy(root().join("tests/host").join(file), &source).unwrap();
        let said = run_with(&build(&source, linked), &[&library()], &[("VRTM_DEVICE", "gpu")]);
        assert!(said.lines().filter(|line| line.starts_with("ok   ")).count() >= at_least, "{file}");
    }
}

#[test]
fn the_readme_s_example_runs() {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let block = readme.split_once("\n```c\n").and_then(|(_, rest)| rest.split_once("\n```\n"));
    let block = block.expect("README.md has no block that starts with ```c").0;
    let file = std::fs::read_to_string(root().join("tests/host/readme.c")).unwrap();
    assert!(file.contains(block), "the C block of README.md does not stand in tests/host/readme.c");
    let program = build(&root().join("tests/host/readme.c"), true);
    let said = run(&program, &[]);
    let numbers: Vec<f32> = said.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    assert!(numbers.len() == 2 && numbers.iter().all(|n| (0.0..=1.0).contains(n)), "{said}");
}

/// Checks every access and that all memory is freed, where valgrind is installed; otherwise it is skipped with a
/// message.
fn run_under_valgrind(file: &str, linked: bool, arguments: &[&Path]) {
    if !long::only("hosts under valgrind") {
        return;
    }
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("skipped: valgrind is not installed");
        return;
    }
    // A program of its own, because the plain run may be building the same source at this time.
    let source = scratch().join(format!("checked_{file}"));
    std::fs::copy(root().join("tests/host").join(file), &source).unwrap();
    let output = Command::new("valgrind")
        .args(["--quiet", "--error-exitcode=9", "--leak-check=full"])
        // "Possibly lost" is the standard library's record of the main thread, which exists as long as that thread.
        .args(["--show-leak-kinds=definite", "--errors-for-leak-kinds=definite"])
        .arg(format!("--suppressions={}", root().join("tests/host/valgrind.supp").display()))
        .arg(build(&source, linked))
        .args(arguments)
        .env_remove("VRTM_DEVICE")
        .env_remove("VRTM_THREADS")
        .env_remove("VRTM_GPU_LIMITS")
        // Without it, a layer of Mesa's Vulkan drivers prints a warning to stderr.
        .env("XDG_RUNTIME_DIR", scratch())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", text(&output));
}

#[test]
fn smoke_under_valgrind() {
    run_under_valgrind("smoke.c", true, &[]);
}

#[test]
fn misuse_under_valgrind() {
    run_under_valgrind("misuse.c", true, &[]);
}

#[test]
fn jobs_under_valgrind() {
    run_under_valgrind("job.c", true, &[]);
}

#[test]
fn unload_under_valgrind() {
    run_under_valgrind("unload.c", false, &[&library()]);
}

/// The C++ wrapper, hosts' contracts, the examples for hosts, and the code in the documents.
mod hosts;
