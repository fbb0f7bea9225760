//! Writes into the shared library the name by which programs find it when they start: libvrtm.so.0, or
//! @rpath/libvrtm.0.dylib on macOS. The number is the major version: it changes when compiled programs would no longer
//! run (the head of include/vrtm.h says what may change within a major version). On Windows programs find a DLL by its
//! file name. With GNU's tools for Windows the linker also sends some calls to src/thread_indices.rs.
//!
//! Exported symbols need no work here: rustc passes the linker a list of exactly the functions of `capi/src`,
//! and tests/c_api/header.rs compares the exports with the header. Symbols have no version names, since GNU's linker
//! does not accept a second list.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let variable = |name: &str| std::env::var(name).unwrap_or_default();
    let [major, minor] = ["MAJOR", "MINOR"].map(|part| variable(&format!("CARGO_PKG_VERSION_{part}")));
    let argument = |text: String| println!("cargo::rustc-cdylib-link-arg={text}");
    if variable("CARGO_CFG_TARGET_VENDOR") == "apple" {
        argument(format!("-Wl,-install_name,@rpath/libvrtm.{major}.dylib"));
        argument(format!("-Wl,-compatibility_version,{major}.{minor}"));
        argument(format!("-Wl,-current_version,{}", variable("CARGO_PKG_VERSION")));
    } else if variable("CARGO_CFG_TARGET_FAMILY") == "unix" {
        argument(format!("-Wl,-soname,libvrtm.so.{major}"));
    } else if variable("CARGO_CFG_TARGET_OS") == "windows"
        && variable("CARGO_CFG_TARGET_ENV") == "gnu"
        && variable("CARGO_CFG_TARGET_ABI") != "llvm"
    {
        // See src/thread_indices.rs.
        argument("-Wl,--wrap=TlsAlloc,--wrap=TlsFree".to_owned());
    }
}
