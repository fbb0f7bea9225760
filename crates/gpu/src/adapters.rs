//! The GPUs of this machine, as found through Vulkan, Direct3D 12 and Metal. GL is left out: its drivers are not fit
//! for render threads.

use std::sync::Arc;

use super::context::Context;
use super::identity::{api, describe, rank};
use vrtm_core::allocation::{Vec, boxed};
use vrtm_core::backend::{Adapter, Adapters, Gpu};
use vrtm_core::panics::contain;

const BACKENDS: wgpu::Backends =
    wgpu::Backends::VULKAN.union(wgpu::Backends::DX12).union(wgpu::Backends::METAL);

/// A GPU's memory is shared with the host and with other programs. An allocation that would raise the use above this
/// percentage of the driver's budget fails with `OutOfMemory`, before the driver starts to page.
const MEMORY_BUDGET_PERCENT: u8 = 95;

/// Looks for adapters. It adds none if no driver is installed, or if it is broken.
pub fn find(found: &mut Adapters) {
    let (usable, rejected) = all();
    found.usable.extend(usable.into_iter().map(|adapter| Adapter {
        info: describe(&adapter),
        open: boxed(move |options| Ok(Arc::new(Context::open(&adapter, options)?) as Arc<dyn Gpu>)),
    }));
    found.rejected.extend(rejected);
    let built = BACKENDS & wgpu::Instance::enabled_backend_features();
    let all = [wgpu::Backend::Vulkan, wgpu::Backend::Dx12, wgpu::Backend::Metal];
    let names = all.into_iter().filter(|&backend| built.contains(backend.into())).map(api);
    found.interfaces.extend(names);
}

/// The adapters that can be used, in the order of `Adapters`; and of each other one the name, with the reason.
pub(super) fn all() -> (Vec<wgpu::Adapter>, Vec<String>) {
    let all = contain(|| pollster::block_on(instance().enumerate_adapters(BACKENDS)));
    let (mut usable, mut others) = (Vec::new(), Vec::new());
    for adapter in all.unwrap_or_default() {
        match rejected(&adapter) {
            Some(why) => others.push(format!("{}, {why}", adapter.get_info().name)),
            None => usable.push(adapter),
        }
    }
    #[expect(clippy::disallowed_methods, reason = "a machine has only a few adapters")]
    usable.sort_by_key(|adapter| rank(adapter.get_info().device_type));
    (usable, others)
}

fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = BACKENDS;
    // Without validation layers, which a debug build would load into the host, and without checks of indirect
    // dispatches, which cost a dispatch each: their arguments are written by this library's own kernel.
    descriptor.flags = wgpu::InstanceFlags::empty();
    descriptor.memory_budget_thresholds.for_resource_creation = Some(MEMORY_BUDGET_PERCENT);
    wgpu::Instance::new(descriptor)
}

/// The reason why an adapter cannot be used, or `None` if it can.
fn rejected(adapter: &wgpu::Adapter) -> Option<&'static str> {
    let compute = wgpu::DownlevelFlags::COMPUTE_SHADERS;
    if !adapter.get_downlevel_capabilities().flags.contains(compute) {
        return Some("which has no compute shaders");
    }
    let enough = wgpu::Limits::defaults().check_limits(&adapter.limits());
    (!enough).then_some("whose limits are under WebGPU's defaults")
}
