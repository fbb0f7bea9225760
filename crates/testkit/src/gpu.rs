//! A device on the first GPU adapter, hardware or software, if there is one.

use crate::long;
use vrtm::{AdapterInfo, Backend, Device, DeviceSettings, adapters};

/// True if there is an adapter; prints a message if there is none. With VRTM_REQUIRE_GPU=1 there must be one. In a
/// short run, tests beside those of `crates/gpu/tests/gpu` leave a software driver alone: it is ten times as slow as
/// the CPU backend.
pub fn has_gpu() -> bool {
    match adapters().first() {
        Some(first) => counts(first) || long::only("tests on a software driver"),
        None => {
            assert!(!required(), "VRTM_REQUIRE_GPU is set, but there is no GPU adapter");
            println!("skipped: no GPU adapter");
            false
        }
    }
}

fn required() -> bool {
    std::env::var_os("VRTM_REQUIRE_GPU").is_some_and(|value| value == "1")
}

fn counts(adapter: &AdapterInfo) -> bool {
    env!("CARGO_CRATE_NAME") == "gpu" || !adapter.software || required()
}

/// The first adapter with its driver, as `tests/bits.txt` names it.
pub fn backend(adapter: &AdapterInfo) -> String {
    format!("{}, {}", adapter.name, adapter.driver)
}

/// The name of the first adapter, if tests run on it.
pub fn counted() -> Option<String> {
    let adapters = adapters();
    adapters.first().filter(|first| counts(first) || long::long()).map(backend)
}

/// A device on the first adapter, with the given settings but for the backend.
pub fn gpu(settings: &DeviceSettings) -> Option<Device> {
    if !has_gpu() {
        return None;
    }
    Some(Device::new(&DeviceSettings { backend: Backend::Gpu, ..settings.clone() }).unwrap())
}
