//! A device on the first GPU adapter, hardware or software, if there is one.

#![allow(dead_code)] // Each test uses some of these items only.

use super::long;
use vrtm::{Backend, Device, DeviceSettings, adapters};

/// True if there is an adapter; prints a message if there is none. With VRTM_REQUIRE_GPU=1 there must be one. In a short
/// run, tests beside those of `tests/gpu` leave a software driver alone: it is ten times as slow as the CPU backend.
pub fn has_gpu() -> bool {
    let required = std::env::var_os("VRTM_REQUIRE_GPU").is_some_and(|value| value == "1");
    if let Some(first) = adapters().first() {
        let counts = env!("CARGO_CRATE_NAME") == "gpu" || !first.software || required;
        return counts || long::only("tests on a software driver");
    }
    assert!(!required, "VRTM_REQUIRE_GPU is set, but there is no GPU adapter");
    println!("skipped: no GPU adapter");
    false
}

/// A device on the first adapter, with the given settings but for the backend.
pub fn gpu(settings: &DeviceSettings) -> Option<Device> {
    if !has_gpu() {
        return None;
    }
    Some(Device::new(&DeviceSettings { backend: Backend::Gpu, ..settings.clone() }).unwrap())
}
