//! An asset shared by several threads. Constant data and results can be read at any time; all else is used by one call
//! at a time. Others fail as busy instead of waiting, since a callback that calls into the asset would wait for itself.

use std::cell::UnsafeCell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use super::status::{Failure, Outcome, VRTM_ERROR_BUSY};
use vrtm::Asset;
use vrtm::Results;
use vrtm_core::control::Control;
use vrtm_core::panics::lock;
use vrtm_core::report::AssetInfo;

/// An asset shared by threads.
#[derive(Debug)]
pub(super) struct SharedAsset {
    /// Facts about the mesh.
    pub info: AssetInfo,
    pub results: Results,
    is_claimed: AtomicBool,
    asset: UnsafeCell<Asset>,
    /// Control of the solve in progress.
    solving: Mutex<Option<Arc<Control>>>,
    /// True once the handle was destroyed.
    ended: AtomicBool,
}

// SAFETY: `asset` is reached through its one `Claim` alone.
unsafe impl Sync for SharedAsset {}

impl SharedAsset {
    pub fn new(asset: Asset) -> SharedAsset {
        SharedAsset {
            info: asset.info(),
            results: asset.results().clone(),
            is_claimed: AtomicBool::new(false),
            asset: UnsafeCell::new(asset),
            solving: Mutex::default(),
            ended: AtomicBool::new(false),
        }
    }

    /// Calls `body` with the asset, of which it has exclusive use.
    pub fn write<R>(self: &Arc<Self>, body: impl FnOnce(&mut Asset) -> Outcome<R>) -> Outcome<R> {
        body(self.claim()?.asset())
    }

    /// Claims the asset for exclusive use by one call or job.
    pub fn claim(self: &Arc<Self>) -> Outcome<Claim> {
        match self.is_claimed.swap(true, Ordering::Acquire) {
            false => Ok(Claim(self.clone())),
            true => Err(Failure::new(VRTM_ERROR_BUSY, "asset: another call, or a job, is using it")),
        }
    }

    /// Cancels the solve in progress, if any.
    pub fn cancel(&self) {
        if let Some(control) = &*lock(&self.solving) {
            control.cancel();
        }
    }

    /// Called when the handle is destroyed: cancels the solve in progress and all later ones.
    pub fn end(&self) {
        self.ended.store(true, Ordering::SeqCst);
        self.cancel();
    }
}

/// Exclusive use of an asset by one call or job until it is dropped. Keeps the asset alive.
#[derive(Debug)]
pub(super) struct Claim(Arc<SharedAsset>);

impl Claim {
    pub fn asset(&mut self) -> &mut Asset {
        // SAFETY: only one claim exists at a time, and the asset is borrowed as long as the claim.
        unsafe { &mut *self.0.asset.get() }
    }

    /// Registers the solve that the claim is for, so that the asset's owner can cancel it, even before it begins.
    pub fn announce(&self, control: &Arc<Control>) {
        *lock(&self.0.solving) = Some(control.clone());
        if self.0.ended.load(Ordering::SeqCst) {
            control.cancel();
        }
    }

    /// Calls `body` with the asset; the asset's owner can cancel it by `control`.
    pub fn solve<R>(&mut self, control: &Arc<Control>, body: impl FnOnce(&mut Asset) -> R) -> R {
        self.announce(control);
        body(self.asset())
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // Clear this first: once the asset is released, another claim may announce its own solve.
        *lock(&self.0.solving) = None;
        self.0.is_claimed.store(false, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::super::guard::guard;
    use super::super::status::VRTM_ERROR_INTERNAL;
    use super::*;
    use vrtm::Device;
    use vrtm_core::mesh::{MeshSource, UvSource};
    use vrtm_core::settings::DeviceSettings;
    use vrtm_core::view::Strided;

    fn triangle() -> Arc<SharedAsset> {
        let device = Device::new(&DeviceSettings::default()).unwrap();
        let mesh = MeshSource {
            positions: Strided::from_f32x3(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
            indices: &[0, 1, 2],
            uvs: UvSource {
                u: Strided::from_f32x2(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
                ..UvSource::default()
            },
            ..MeshSource::default()
        };
        Arc::new(SharedAsset::new(Asset::new(&device, &mesh).unwrap()))
    }

    #[test]
    fn an_asset_survives_a_panic() {
        let asset = triangle();
        let status = guard("vrtm_test", || asset.write(|_| -> Outcome<()> { panic!("in the middle") }));
        assert_eq!(status, VRTM_ERROR_INTERNAL);
        assert!(asset.write(|asset| Ok(asset.set_rigidity(0, None)?)).is_ok());
    }
}
