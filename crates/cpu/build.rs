//! Chooses the processor levels. AVX-512 takes a third of the time to build: tests in the profile `dev` do without it.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(avx512)");
    if std::env::var("PROFILE").as_deref() != Ok("debug") {
        println!("cargo::rustc-cfg=avx512");
    }
}
