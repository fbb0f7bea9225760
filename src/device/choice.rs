//! Finds the GPUs of this machine, and opens the one that a device is to have.

use std::sync::Arc;

use vrtm_core::backend::{Adapter, Adapters, Gpu, Options};
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::report::AdapterInfo;
use vrtm_core::settings::{AdapterId, DeviceSettings};

/// The backends for GPUs that this build has: each adds the adapters that it finds.
const BACKENDS: &[fn(&mut Adapters)] = &[
    #[cfg(feature = "gpu")]
    vrtm_gpu::adapters::find,
];

pub(super) fn find() -> Adapters {
    let mut found = Adapters::default();
    BACKENDS.iter().for_each(|find| find(&mut found));
    found
}

/// Opens the GPU requested by number or identity; also describes which one it is.
pub(super) fn open(
    settings: &DeviceSettings,
    origin: &str,
    options: Options,
) -> Result<(Arc<dyn Gpu>, String)> {
    let found = find();
    let count = found.usable.len();
    if count == 0 {
        let interfaces = match BACKENDS {
            [] => "none: this build has no GPU backend".to_owned(),
            _ => found.interfaces.join(", "),
        };
        let message = format!(
            "backend: gpu was asked for{origin}, but there is no GPU that runs compute shaders with WebGPU's default limits \
             (looked through {interfaces}; found: {})",
            found.listed()
        );
        return Err(Error::new(ErrorKind::Unsupported, message));
    }
    let index = match settings.adapter_id {
        Some(id) => place(&found, id).ok_or_else(|| nowhere(&found, id))?,
        None => settings.adapter as usize,
    };
    let adapter = found.usable.get(index).ok_or_else(|| {
        let s = if count == 1 { "" } else { "s" };
        Error::argument(format!("adapter: {index} is out of range, there is {count} adapter{s}"))
    })?;
    let by = settings.adapter_id.map_or(String::new(), |id| format!(", by its {id}"));
    let which = format!("adapter {index} of {count}{by}, {}", through(&adapter.info, options));
    Ok(((adapter.open)(options)?, which))
}

/// The number of the adapter with this identity.
fn place(found: &Adapters, id: AdapterId) -> Option<usize> {
    found.usable.iter().position(|adapter| adapter.info.has_id(id))
}

fn nowhere(found: &Adapters, id: AdapterId) -> Error {
    let mut message = format!("adapter_id: no adapter has the {id}; there are");
    for (index, Adapter { info, .. }) in found.usable.iter().enumerate() {
        let comma = if index == 0 { ":" } else { ";" };
        message += &format!("{comma} {index}: {} through {}", info.name, info.api);
        info.ids().for_each(|id| message += &format!(", {id}"));
    }
    Error::argument(message)
}

/// The choice of `auto`: the GPU with this identity if one is given, otherwise the first suitable one, or the CPU; and
/// the reason.
pub(super) fn choose(id: Option<AdapterId>, options: Options) -> (Option<Arc<dyn Gpu>>, String) {
    let found = find();
    let index = match id.map(|id| (id, place(&found, id))) {
        None => 0,
        Some((_, Some(index))) => index,
        Some((id, None)) => {
            return (None, format!("the CPU, as no GPU has the {id} (found: {})", found.listed()));
        }
    };
    match found.usable.get(index).filter(|adapter| !adapter.info.software) {
        Some(adapter) => or_the_cpu((adapter.open)(options), options),
        None => (None, format!("no hardware GPU (found: {})", found.listed())),
    }
}

/// The chosen GPU if it could be opened, otherwise the CPU.
fn or_the_cpu(opened: Result<Arc<dyn Gpu>>, options: Options) -> (Option<Arc<dyn Gpu>>, String) {
    match opened {
        Ok(gpu) => {
            let why = format!("a hardware GPU, {}", through(gpu.info(), options));
            (Some(gpu), why)
        }
        Err(error) => (None, format!("the CPU, as the GPU cannot be used: {}", error.message)),
    }
}

fn through(info: &AdapterInfo, options: Options) -> String {
    let software = if info.software { ", a software driver" } else { "" };
    let limits = if options.webgpu_limits { ", with WebGPU's default limits" } else { "" };
    format!("through {} ({}){software}{limits}", info.api, info.driver)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auto_falls_back_to_the_cpu_and_says_why() {
        let refused = Error::new(ErrorKind::Unsupported, "adapter: X cannot be opened: no more devices");
        let (gpu, why) = or_the_cpu(Err(refused), Options::default());
        assert!(gpu.is_none());
        assert_eq!(why, "the CPU, as the GPU cannot be used: adapter: X cannot be opened: no more devices");
    }
}
