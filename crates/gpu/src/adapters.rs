//! The GPUs of this machine, as found through Vulkan, Direct3D 12 and Metal. GL is left out: its drivers are not fit
//! for render threads.

use super::context::{Context, Options};
use super::identity::{api, describe, is_software, rank};
use vrtm_core::allocation::{Collect, Grow};
use vrtm_core::error::Result;
use vrtm_core::panics::contain;
use vrtm_core::report::AdapterInfo;

const BACKENDS: wgpu::Backends =
    wgpu::Backends::VULKAN.union(wgpu::Backends::DX12).union(wgpu::Backends::METAL);

/// A GPU's memory is shared with the host and with other programs. An allocation that would raise the use above this
/// percentage of the driver's budget fails with `OutOfMemory`, before the driver starts to page.
const MEMORY_BUDGET_PERCENT: u8 = 95;

/// The adapters found: the usable ones, and the reasons why the others were rejected.
#[derive(Debug, Default)]
pub struct Adapters {
    /// Hardware before software, discrete before integrated; otherwise in the order of the drivers.
    pub usable: Vec<wgpu::Adapter>,
    /// Name of each adapter that cannot be used, with the reason.
    pub rejected: Vec<String>,
}

impl Adapters {
    /// Enumerates the adapters. Both lists are empty if no driver is installed, or if it is broken.
    pub fn new() -> Adapters {
        let all = contain(|| pollster::block_on(instance().enumerate_adapters(BACKENDS)));
        let mut found = Adapters::default();
        for adapter in all.unwrap_or_default() {
            match rejected(&adapter) {
                Some(why) => found.rejected.put(format!("{}, {why}", adapter.get_info().name)),
                None => found.usable.put(adapter),
            }
        }
        #[expect(clippy::disallowed_methods, reason = "a machine has only a few adapters")]
        found.usable.sort_by_key(|adapter| rank(adapter.get_info().device_type));
        found
    }

    /// Describes the GPUs that can be used.
    pub fn infos(&self) -> Vec<AdapterInfo> {
        self.usable.iter().map(describe).collected()
    }

    /// Opens the usable adapter `index`; `None` if the index is out of range.
    pub fn open(&self, index: usize, options: Options) -> Option<Result<Context>> {
        self.usable.get(index).map(|adapter| Context::open(adapter, options))
    }

    /// Lists the adapters found, for an error message.
    pub fn listed(&self) -> String {
        let usable = self.usable.iter().map(|adapter| {
            let info = adapter.get_info();
            if is_software(&info) { format!("{}, a software driver", info.name) } else { info.name }
        });
        let all: Vec<String> = usable.chain(self.rejected.iter().cloned()).collected();
        if all.is_empty() { "none".to_owned() } else { all.join("; ") }
    }
}

/// Names of the graphics interfaces that this build supports.
pub fn interfaces() -> String {
    let built = BACKENDS & wgpu::Instance::enabled_backend_features();
    let named = [
        (wgpu::Backends::VULKAN, wgpu::Backend::Vulkan),
        (wgpu::Backends::DX12, wgpu::Backend::Dx12),
        (wgpu::Backends::METAL, wgpu::Backend::Metal),
    ];
    let names = named.into_iter().filter(|(bit, _)| built.contains(*bit)).map(|(_, backend)| api(backend));
    names.collected().join(", ")
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
