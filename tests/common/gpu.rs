//! A device on the first GPU adapter, hardware or software, if there is one.

#![allow(dead_code)] // Each test uses some of these items only.

use vrtm::{Backend, Device, DeviceSettings, adapters};

/// True if there is an adapter; prints a message if there is none. With VRTM_REQUIRE_GPU=1 there must be one.
pub fn has_gpu() -> bool {
    if !adapters().is_empty() {
        return true;
    }
    let required = std::env::var_os("VRTM_REQUIRE_GPU").is_some_and(|value| value == "1");
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
