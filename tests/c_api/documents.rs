//! A C and a C++ host for every run (tests/hosts has the others), and the code in the documents.

#![cfg(any(unix, all(windows, target_env = "gnu")))]

use std::collections::BTreeSet;

use crate::tools::{check_cases, host, root, run};

#[test]
fn a_c_host() {
    check_cases(&run(&host("smoke.c"), &[]), 50);
}

#[test]
fn a_cpp_host() {
    check_cases(&run(&host("grid.cpp"), &[]), 3);
}

#[test]
fn the_readme_s_example_runs() {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let block = readme.split_once("\n```c\n").and_then(|(_, rest)| rest.split_once("\n```\n"));
    let block = block.expect("README.md has no block that starts with ```c").0;
    let file = std::fs::read_to_string(root().join("tests/host/readme.c")).unwrap();
    assert!(file.contains(block), "the C block of README.md does not stand in tests/host/readme.c");
    let said = run(&host("readme.c"), &[]);
    let numbers: Vec<f32> = said.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    assert!(numbers.len() == 2 && numbers.iter().all(|n| (0.0..=1.0).contains(n)), "{said}");
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
    let tested = called(&tests);
    let used = |name: &str| ["(", ","].iter().any(|end| wrapper.contains(&format!("{name}{end}")));
    let missing: Vec<_> = functions(&header)
        .into_iter()
        .filter(|name| !used(name))
        .filter(|name| *name != "vrtm_defaults") // For languages without the header's inline functions.
        .collect();
    assert!(missing.is_empty(), "not in vrtm.hpp: {missing:?}");

    // Those that can fail return a Result; a line that ends with a semicolon has a variable.
    let own: BTreeSet<_> = (wrapper.lines())
        .map(|line| line.trim_start().trim_start_matches("static ").trim_start_matches("inline "))
        .filter(|line| line.starts_with("Result<") && !line.ends_with(';'))
        .filter_map(|line| line.split_once('(')?.0.rsplit_once(' '))
        .map(|(_, name)| name)
        .filter(|name| *name != "get") // It is not of the interface.
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

/// Lines without their indentation: a document may show a part of a function.
fn unindented(text: &str) -> String {
    text.lines().map(|line| format!("{}\n", line.trim_start())).collect()
}

/// Documents show code that runs: each block stands in one of the programs above, line for line.
#[test]
fn the_code_in_the_documents_is_in_programs_that_run() {
    let programs = [
        "examples/hosts/houdini/SOP_VrtmWarp.cpp",
        "tests/host/farm.cpp",
        "tests/host/grid.cpp",
        "tests/host/maya_plugin.cpp",
        "tests/host/viewport.cpp",
        "tests/host/wrapper.cpp",
    ]
    .map(|path| unindented(&read(path)));
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
