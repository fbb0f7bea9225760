//! The C++ wrapper, the plug-in as in Maya, and the examples for hosts.

use super::*;

const WITHOUT_EXCEPTIONS: [&str; 2] = ["-fno-exceptions", "-fno-rtti"];

#[test]
fn the_wrapper_with_exceptions() {
    let wrapper = build(Path::new("tests/host/wrapper.cpp"), "wrapper", &[], true);
    check_cases(&run(&wrapper, &[]), 180);
    let throwing = build(Path::new("tests/host/wrapper_throws.cpp"), "wrapper_throws", &[], true);
    check_cases(&run(&throwing, &[]), 7);
}

#[test]
fn the_wrapper_without_exceptions() {
    if !long::only("the wrapper's tests without exceptions") {
        return;
    }
    let options = WITHOUT_EXCEPTIONS;
    let wrapper = build(Path::new("tests/host/wrapper.cpp"), "wrapper_without_exceptions", &options, true);
    check_cases(&run(&wrapper, &[]), 180);
}

#[test]
fn the_wrapper_as_cpp20() {
    // Whether it compiles without a warning is all that C++20 can change.
    for (file, options) in [("wrapper", &[][..]), ("wrapper_throws", &[]), ("wrapper", &WITHOUT_EXCEPTIONS)] {
        let options = [&["-std=c++20", "-fsyntax-only"][..], options].concat();
        build(Path::new(&format!("tests/host/{file}.cpp")), &format!("{file}_20"), &options, false);
    }
}

/// The option that has a host's classes found in their stand-ins: each header of the host's that its example includes
/// is written, and leads to them.
fn stand_ins(host: &str, example: &str) -> String {
    let folder = scratch().join("stand_ins").join(host);
    let stand_in = root().join(format!("tests/host/stand_ins/{host}.hpp"));
    let source = std::fs::read_to_string(root().join("examples/hosts").join(host).join(example)).unwrap();
    for header in source.lines().filter_map(|line| line.strip_prefix("#include <")?.strip_suffix(".h>")) {
        let file = folder.join(format!("{header}.h"));
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, format!("#include {stand_in:?}\n")).unwrap();
    }
    format!("-I{}", folder.display())
}

#[test]
fn the_example_for_houdini_runs() {
    let options = [&*stand_ins("houdini", "SOP_VrtmWarp.cpp")];
    let host =
        build(Path::new("tests/host/stand_ins/houdini_example.cpp"), "houdini_example", &options, true);
    check_cases(&run(&host, &[]), 18);
}

#[test]
fn the_example_for_maya_runs() {
    let options = [&*stand_ins("maya", "vrtm_warp_node.cpp")];
    let host = build(Path::new("tests/host/stand_ins/maya_example.cpp"), "maya_example", &options, true);
    check_cases(&run(&host, &[&scratch().join("maya_example_maps")]), 36);
}

#[test]
#[cfg(any(target_os = "linux", windows))] // It asks the system what is mapped.
fn a_node_as_in_maya() {
    let options = [&["-shared"][..], &WITHOUT_EXCEPTIONS].concat();
    let plugin = build(Path::new("tests/host/maya_plugin.cpp"), "maya_plugin.so", &options, true);
    let host = build(Path::new("tests/host/maya_node.cpp"), "maya_node", &[], false);
    let rounds = long::cases(100, 25, "rounds of loading and unloading").to_string();
    check_cases(&run(&host, &[&plugin, Path::new(&rounds)]), 29);
}
