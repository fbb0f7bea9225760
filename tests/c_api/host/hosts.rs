//! The C++ wrapper, the programs that keep a host's contract, the examples for hosts, and the code in the documents.

use std::collections::BTreeSet;

use super::*;

/// Compiles a program or, with `-shared`, a library, with warnings as errors and further options.
fn build_with(source: &str, name: &str, options: &[&str], linked: bool) -> PathBuf {
    let built = if name.contains('.') { scratch().join(name) } else { program(name) };
    let mut command = Command::new(compiler("cpp"));
    command
        .args([optimisation(), "-g", "-Wall", "-Wextra", "-pedantic", "-Werror", "-pthread"])
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
    let output = command.output().unwrap_or_else(|error| panic!("{:?}: {error}", compiler("cpp")));
    assert!(output.status.success(), "{command:?}:\n{}", text(&output));
    built
}

const WITHOUT_EXCEPTIONS: [&str; 2] = ["-fno-exceptions", "-fno-rtti"];

fn check_cases(said: &str, at_least: usize) {
    let cases = said.lines().filter(|line| line.starts_with("ok   ")).count();
    assert!(cases >= at_least, "only {cases} cases ran");
    assert!(said.lines().all(|line| line.starts_with("ok   ") || line == "0 failed"), "{said}");
}

#[test]
fn the_wrapper_with_exceptions() {
    let wrapper = build_with("tests/host/wrapper.cpp", "wrapper", &["-std=c++17"], true);
    check_cases(&run(&wrapper, &[]), 180);
    let throwing = build_with("tests/host/wrapper_throws.cpp", "wrapper_throws", &["-std=c++17"], true);
    check_cases(&run(&throwing, &[]), 7);
}

#[test]
fn the_wrapper_without_exceptions() {
    if !long::only("the wrapper's tests without exceptions") {
        return;
    }
    let options = [&["-std=c++17"][..], &WITHOUT_EXCEPTIONS].concat();
    let wrapper = build_with("tests/host/wrapper.cpp", "wrapper_without_exceptions", &options, true);
    check_cases(&run(&wrapper, &[]), 180);
}

#[test]
fn the_wrapper_as_cpp20() {
    // Whether it compiles without a warning is all that C++20 can change.
    for (file, options) in [("wrapper", &[][..]), ("wrapper_throws", &[]), ("wrapper", &WITHOUT_EXCEPTIONS)] {
        let options = [&["-std=c++20", "-fsyntax-only"][..], options].concat();
        build_with(&format!("tests/host/{file}.cpp"), &format!("{file}_20"), &options, false);
    }
}

fn read(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The words of C and C++ code before an opening parenthesis.
fn called(code: &str) -> BTreeSet<&str> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    code.match_indices('(')
        .map(|(at, _)| &code[code[..at].rfind(|c| !is_part(c)).map_or(0, |before| before + 1)..at])
        .collect()
}

#[test]
fn the_wrapper_has_every_function_of_the_header_and_a_test_of_each_of_its_own() {
    let (header, wrapper) = (read("include/vrtm.h"), read("include/vrtm.hpp"));
    let tests = read("tests/host/wrapper.cpp");
    let (own, tested) = (called(&wrapper), called(&tests));
    let missing: Vec<_> = functions(&header)
        .into_iter()
        .filter(|name| !own.contains(name))
        .filter(|name| *name != "vrtm_defaults") // For languages without the header's inline functions.
        .collect();
    assert!(missing.is_empty(), "not in vrtm.hpp: {missing:?}");

    // Those that can fail return a Result; a line that ends with a semicolon has a variable.
    let own: BTreeSet<_> = (wrapper.lines())
        .map(|line| line.trim_start().trim_start_matches("static ").trim_start_matches("inline "))
        .filter(|line| line.starts_with("Result<") && !line.ends_with(';'))
        .filter_map(|line| line.split_once('(')?.0.rsplit_once(' '))
        .map(|(_, name)| name)
        .collect();
    assert!(own.len() > 25, "only {} functions found", own.len());
    for name in own {
        assert!(tested.contains(name), "{name} is not in wrapper.cpp");
    }
}

/// The names of the functions that `vrtm.h` declares.
fn functions(header: &str) -> Vec<&str> {
    (header.split("VRTM_API").skip(1))
        .filter_map(|declaration| declaration.split_once('(')?.0.split_whitespace().last())
        .map(|name| name.trim_start_matches('*'))
        .filter(|name| name.starts_with("vrtm_"))
        .collect()
}

/// The option that has a host's classes found in their stand-ins.
fn stand_ins(host: &str) -> String {
    format!("-I{}", root().join("tests/host/stand_ins").join(host).display())
}

#[test]
fn the_example_for_houdini_runs() {
    let options = ["-std=c++17", &stand_ins("houdini")];
    let host = build_with("tests/host/stand_ins/houdini_example.cpp", "houdini_example", &options, true);
    check_cases(&run(&host, &[]), 18);
}

#[test]
fn the_example_for_maya_runs() {
    let options = ["-std=c++17", &stand_ins("maya")];
    let host = build_with("tests/host/stand_ins/maya_example.cpp", "maya_example", &options, true);
    check_cases(&run(&host, &[&scratch().join("maya_example_maps")]), 36);
}

/// Lines without their indentation: a document may show a part of a function.
fn unindented(text: &str) -> String {
    text.lines().map(|line| format!("{}\n", line.trim_start())).collect()
}

/// Documents show code that runs: each block stands in one of the programs above, line for line.
#[test]
fn the_code_in_the_documents_is_in_programs_that_run() {
    let programs: Vec<String> = ["maya_plugin", "houdini_cook", "viewport", "farm", "grid", "wrapper"]
        .map(|name| unindented(&read(&format!("tests/host/{name}.cpp"))))
        .to_vec();
    let document = read("docs/hosts.md");
    let mut fences = document.split("\n```");
    let mut blocks = 0;
    // Text, block, text, block, ...
    while let (Some(_), Some(block)) = (fences.next(), fences.next()) {
        let (language, code) = block.split_once('\n').unwrap();
        assert_eq!(language, "cpp", "a block of another language has no test: {block}");
        let code = unindented(code);
        assert!(programs.iter().any(|program| program.contains(&code)), "no program has this:\n{block}");
        blocks += 1;
    }
    assert!(blocks >= 8, "only {blocks} blocks found");
}

#[test]
fn the_documents_speak_of_every_function_and_status() {
    let (document, header) = (read("docs/hosts.md"), read("include/vrtm.h"));
    let tables: Vec<&str> = document.lines().filter(|line| line.starts_with("| ")).collect();
    let stated = header.lines().filter_map(|line| line.strip_prefix("#define ")?.split_whitespace().next());
    let stated: Vec<_> =
        stated.filter(|name| *name == "VRTM_OK" || name.starts_with("VRTM_ERROR_")).collect();
    let names = [functions(&header), stated].concat();
    assert!(names.len() > 45, "only {} names found", names.len());
    for name in names {
        let in_row = |row: &&str| row.split('|').nth(1).unwrap().contains(&format!("`{name}`"));
        assert_eq!(tables.iter().filter(|row| in_row(row)).count(), 1, "rows for {name} in docs/hosts.md");
    }
}

#[test]
#[cfg(target_os = "linux")] // A program's own pthread_create is what the library calls.
fn threads_of_frames() {
    let program = build(&root().join("tests/host/frame_threads.c"), true);
    check_cases(&run(&program, &[]), 22);
}

#[test]
fn grids_for_features() {
    let host = build_with("tests/host/grid.cpp", "grid", &["-std=c++17"], true);
    check_cases(&run(&host, &[]), 3);
}

#[test]
fn a_farm() {
    let host = build_with("tests/host/farm.cpp", "farm", &["-std=c++17"], true);
    check_cases(&run(&host, &[]), 10);
}

#[test]
#[cfg(any(target_os = "linux", windows))] // It asks the system what is mapped.
fn a_node_as_in_maya() {
    let options = [&["-std=c++17", "-shared"][..], &WITHOUT_EXCEPTIONS].concat();
    let plugin = build_with("tests/host/maya_plugin.cpp", "maya_plugin.so", &options, true);
    let host = build_with("tests/host/maya_node.cpp", "maya_node", &["-std=c++17"], false);
    let rounds = long::cases(100, 25, "rounds of loading and unloading").to_string();
    check_cases(&run(&host, &[&plugin, Path::new(&rounds)]), 29);
}

#[test]
fn a_cook_as_in_houdini() {
    let host = build_with("tests/host/houdini_cook.cpp", "houdini_cook", &["-std=c++17"], true);
    check_cases(&run(&host, &[]), 32);
}

#[test]
fn a_viewport() {
    let host = build_with("tests/host/viewport.cpp", "viewport", &["-std=c++17"], true);
    check_cases(&run(&host, &[]), 9);
}
