//! A device on the first GPU adapter, hardware or software, if there is one.

use vrtm::{AdapterInfo, Backend, Device, DeviceSettings, adapters};

use crate::model::cpu;

/// True if there is an adapter; prints a message if there is none. With VRTM_REQUIRE_GPU=1 there must be one. Without
/// the feature `gpu` tests leave GPUs alone.
pub fn has_gpu() -> bool {
    if cfg!(not(feature = "gpu")) {
        println!("without tests on a GPU; the feature gpu has them");
        return false;
    }
    let found = !adapters().is_empty();
    let required = std::env::var_os("VRTM_REQUIRE_GPU").is_some_and(|value| value == "1");
    assert!(found || !required, "VRTM_REQUIRE_GPU is set, but there is no GPU adapter");
    if !found {
        println!("skipped: no GPU adapter");
    }
    found
}

/// All adapters, if there is one: see `has_gpu`.
pub fn gpus() -> Option<Vec<AdapterInfo>> {
    has_gpu().then(adapters)
}

/// The first adapter with its driver, as `tests/bits.txt` names it.
pub fn backend(adapter: &AdapterInfo) -> String {
    format!("{}, {}", adapter.name, adapter.driver)
}

/// A device on the first adapter, with the given settings but for the backend.
pub fn gpu(settings: &DeviceSettings) -> Option<Device> {
    if !has_gpu() {
        return None;
    }
    Some(Device::new(&DeviceSettings { backend: Backend::Gpu, ..settings.clone() }).unwrap())
}

/// The CPU on all cores, and a GPU if there is one.
pub fn devices() -> Vec<Device> {
    std::iter::once(cpu(0)).chain(gpu(&DeviceSettings::default())).collect()
}

/// Two tests of one check: on the CPU, and on a GPU if there is one. The check gets the device and what stands in
/// brackets behind the test's name, such as the cells a side that there is time for.
#[macro_export]
macro_rules! on_both {
    ($cpu:ident($($of_cpu:expr),*), $gpu:ident($($of_gpu:expr),*): $check:path) => {
        #[test]
        fn $cpu() {
            $check(&$crate::cpu(0), $($of_cpu),*);
        }

        #[test]
        fn $gpu() {
            if let Some(device) = $crate::gpu(&Default::default()) {
                $check(&device, $($of_gpu),*);
            }
        }
    };
}
