//! The C++ wrapper, the programs that keep a host's contract, the examples for hosts, and the code in the documents.

use std::collections::BTreeSet;

use super::*;

/// Compiles a program or, with `-shared`, a library, with warnings as errors and further options.
fn build_with(source: &str, name: &str, options: &[&str], linked: bool) -> PathBuf {
    let built = scratch().join(name);
    let mut command = Command::new(compiler("cpp"));
    command.args(["-O1", "-g", "-Wall", "-Wextra", "-pedantic", "-Werror", "-pthread", "-fPIC"]).args(options);
    for folder in ["include", "tests/host"] {
        command.arg("-I").arg(root().join(folder));
    }
    command.arg(root().join(source)).arg("-o").arg(&built);
    if linked {
        let library = library();
        let folder = library.parent().unwrap().display();
        command.arg(format!("-L{folder}")).arg("-lvrtm").arg(format!("-Wl,-rpath,{folder}"));
    }
    command.args(["-lm", "-ldl"]);
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
    check_cases(&run(&throwing, &[]), 55);
}

#[test]
fn the_wrapper_without_exceptions() {
    let options = [&["-std=c++17"][..], &WITHOUT_EXCEPTIONS].concat();
    let wrapper = build_with("tests/host/wrapper.cpp", "wrapper_without_exceptions", &options, true);
    check_cases(&run(&wrapper, &[]), 180);
}

#[test]
fn the_wrapper_as_cpp20() {
    build_with("tests/host/wrapper.cpp", "wrapper_20", &["-std=c++20", "-c"], false);
    build_with("tests/host/wrapper_throws.cpp", "wrapper_throws_20", &["-std=c++20", "-c"], false);
    let options = [&["-std=c++20", "-c"][..], &WITHOUT_EXCEPTIONS].concat();
    build_with("tests/host/wrapper.cpp", "wrapper_20_without_exceptions", &options, false);
}

fn read(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The words of C and C++ code that start with `start` and are called: `(` or `{` follows.
fn called<'a>(code: &'a str, start: &str) -> BTreeSet<&'a str> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    code.match_indices(start)
        .filter(|(at, _)| !code[..*at].ends_with(is_part))
        .map(|(at, _)| &code[at..])
        .filter_map(|rest| rest.split_once(|c| !is_part(c)).map(|(word, _)| (word, &rest[word.len()..])))
        .filter(|(_, after)| after.starts_with('('))
        .map(|(word, _)| word)
        .collect()
}

#[test]
fn the_wrapper_has_every_function_of_the_header_and_a_test_of_each_of_its_own() {
    let (header, wrapper) = (read("include/vrtm.h"), read("include/vrtm.hpp"));
    let (tests, throwing) = (read("tests/host/wrapper.cpp"), read("tests/host/wrapper_throws.cpp"));
    // Two are left out, because the same function of a UV set is a wider form of each.
    let missing: Vec<_> = (header.split("VRTM_API").skip(1))
        .filter_map(|declaration| declaration.split_once('(')?.0.split_whitespace().last())
        .map(|name| name.trim_start_matches('*'))
        .filter(|name| name.starts_with("vrtm_") && !wrapper.contains(&format!("{name}(")))
        .filter(|name| !["vrtm_asset_find_tile", "vrtm_asset_fetch_corner_uvs"].contains(name))
        .collect();
    assert!(missing.is_empty(), "not in vrtm.hpp: {missing:?}");

    let forms = called(&wrapper, "try_");
    assert!(forms.len() > 30, "only {} functions found", forms.len());
    let tested = called(&tests, "try_");
    let untested: Vec<_> = forms.difference(&tested).collect();
    assert!(untested.is_empty(), "not in wrapper.cpp: {untested:?}");
    for form in forms {
        let throws = form.trim_start_matches("try_");
        assert!(!called(&wrapper, throws).is_empty(), "{form} has no form that throws");
        assert!(!called(&throwing, throws).is_empty(), "{throws} is not in wrapper_throws.cpp");
    }
}

#[test]
#[cfg(target_os = "linux")] // It reads /proc.
fn a_node_as_in_maya() {
    let options = [&["-std=c++17", "-shared"][..], &WITHOUT_EXCEPTIONS].concat();
    let plugin = build_with("tests/host/maya_plugin.cpp", "maya_plugin.so", &options, true);
    let host = build_with("tests/host/maya_node.cpp", "maya_node", &["-std=c++17"], false);
    check_cases(&run(&host, &[&plugin]), 29);
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
