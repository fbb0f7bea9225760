//! Programs of tests/host.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::tools::{build, check_cases, host, library, root, run, run_with, scratch, text, without_settings};
use vrtm_testkit::{gpu, long};

mod cpp;

/// Hosts that need no arguments, and the least number of their cases.
macro_rules! hosts {
    ($($(#[$attribute:meta])* $name:ident: $file:literal, $at_least:literal;)*) => {$(
        #[test]
        $(#[$attribute])*
        fn $name() {
            check_cases(&run(&host($file), &[]), $at_least);
        }
    )*};
}

hosts! {
    misuse: "misuse.c", 261;
    mesh: "mesh.c", 88;
    float_mode: "float_mode.c", 26;
    #[cfg(any(target_os = "linux", windows))] // It counts the process's threads, as the system tells them.
    jobs: "job.c", 118;
    jobs_on_a_host_s_threads: "job_threads.c", 35;
    refinements: "refine.c", 52;
    carriers: "carry.c", 45;
    #[cfg(unix)]
    forks_and_signals_do_no_harm: "process.c", 26;
    // The header says which stack a caller needs.
    a_stack_of_48_kib_is_enough_on_the_cpu: "stack.c", 9;
    #[cfg(target_os = "linux")] // A program's own pthread_create is what the library calls.
    threads_of_frames: "frame_threads.c", 17;
    a_farm: "farm.cpp", 10;
    a_viewport: "viewport.cpp", 6;
}

#[test]
#[cfg(any(target_os = "linux", windows))]
fn memory_goes_back_after_the_last_asset() {
    let rounds = long::cases(2, 1, "rounds").to_string();
    check_cases(&run(&host("memory.c"), &[Path::new(&rounds)]), 25);
}

#[test]
#[cfg(any(target_os = "linux", windows))]
fn ten_thousand_solves_leave_nothing_behind() {
    let solves = long::cases(10_000, 2000, "solves").to_string();
    check_cases(&run(&host("soak.c"), &[Path::new(&solves)]), 15);
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
    let program = host("locale.c");
    let said = run_with(&program, &[Path::new("de_DE.UTF-8")], &[("LOCPATH", folder.to_str().unwrap())]);
    check_cases(&said, 20);
}

/// Number of allocations, evenly spaced, at which a step of a host's work fails for want of memory.
/// VRTM_ALLOCATE_ROUNDS sets another number; 0 lets each allocation fail in turn.
fn rounds(all: u64, few: u64) -> PathBuf {
    let rounds = || long::cases(all, few, "allocations of each step that fail").to_string().into();
    std::env::var_os("VRTM_ALLOCATE_ROUNDS").unwrap_or_else(rounds).into()
}

fn run_allocate(program: &Path, way: &str, rounds: &Path) {
    check_cases(&run(program, &[Path::new(way), rounds]), 1);
}

#[test]
fn allocations_of_a_host_s_allocator_fail() {
    let program = host("allocate.c");
    run_allocate(&program, "cpu", &rounds(8, 1));
    if gpu::has_gpu() && long::only("failures on a GPU") {
        run_allocate(&program, "gpu", &rounds(2, 1));
    }
}

/// In a process whose memory is short, with nothing of vrtm's help.
#[test]
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn allocations_of_the_system_fail() {
    let program = host("allocate_outside.c");
    run_allocate(&program, "interposed", &rounds(4, 1));
    if long::only("limits of address space") {
        run_allocate(&program, "limited", Path::new("0"));
    }
}

#[test]
fn unload() {
    let program = build(Path::new("tests/host/unload.c"), "host_unload", &[], false);
    let said = run(&program, &[&library()]);
    check_cases(&said, 24);
}

/// As in a session in which a plug-in is worked on: nothing that a process has few of is lost.
#[test]
fn a_thousand_loads() {
    let rounds = long::cases(1000, 300, "loads").to_string();
    let program = build(Path::new("tests/host/reload.c"), "host_reload", &[], false);
    let said = run(&program, &[&library(), Path::new(&rounds)]);
    assert_eq!(said.lines().filter(|line| line.starts_with("ok   ")).count(), 8);
}

/// A list of hashes, which tests/targets/run.sh compares with those of other systems and processors.
#[test]
fn bits_for_other_targets() {
    let program = host("bits.c");
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
        let program = build(&Path::new("tests/host").join(file), &format!("gpu_{}", &file[..4]), &[], linked);
        let said = run_with(&program, &[&library()], &[("VRTM_DEVICE", "gpu")]);
        assert!(said.lines().filter(|line| line.starts_with("ok   ")).count() >= at_least, "{file}");
    }
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
    let program = build(&Path::new("tests/host").join(file), &format!("checked_{}", &file[..3]), &[], linked);
    let output = without_settings(&mut Command::new("valgrind"))
        .args(["--quiet", "--error-exitcode=9", "--leak-check=full"])
        // "Possibly lost" is the standard library's record of the main thread, which exists as long as that thread.
        .args(["--show-leak-kinds=definite", "--errors-for-leak-kinds=definite"])
        .arg(format!("--suppressions={}", root().join("tests/host/valgrind.supp").display()))
        .arg(program)
        .args(arguments)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", text(&output));
}

macro_rules! under_valgrind {
    ($($name:ident: $file:literal, $linked:literal, $arguments:expr;)*) => {$(
        #[test]
        fn $name() {
            run_under_valgrind($file, $linked, $arguments);
        }
    )*};
}

under_valgrind! {
    smoke_under_valgrind: "smoke.c", true, &[];
    misuse_under_valgrind: "misuse.c", true, &[];
    jobs_under_valgrind: "job.c", true, &[];
    unload_under_valgrind: "unload.c", false, &[&library()];
}
