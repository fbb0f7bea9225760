//! An asset shared by several threads. Constant data and results can be read at any time; other data is used either by
//! one call that changes it or by any number of calls that read it. Calls fail as busy instead of waiting, since a
//! callback that calls into the asset would wait for itself.

use std::cell::UnsafeCell;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
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
    /// Number of calls that read the asset; `WRITER` while one call changes it.
    users: AtomicUsize,
    asset: UnsafeCell<Asset>,
    /// Control of the solve in progress.
    solving: Mutex<Option<Arc<Control>>>,
    /// True once the handle was destroyed.
    ended: AtomicBool,
}

// SAFETY: `asset` is reached through `read` and `Claim` alone, which `users` keeps apart.
unsafe impl Sync for SharedAsset {}

const WRITER: usize = usize::MAX;

impl SharedAsset {
    pub fn new(asset: Asset) -> SharedAsset {
        SharedAsset {
            info: asset.info(),
            results: asset.results().clone(),
            users: AtomicUsize::new(0),
            asset: UnsafeCell::new(asset),
            solving: Mutex::default(),
            ended: AtomicBool::new(false),
        }
    }

    /// For calls that only read; any number may run at once.
    pub fn read<R>(&self, body: impl FnOnce(&Asset) -> Outcome<R>) -> Outcome<R> {
        struct Reading<'a>(&'a AtomicUsize);
        impl Drop for Reading<'_> {
            fn drop(&mut self) {
                self.0.fetch_sub(1, Ordering::Release);
            }
        }
        let enter = |users: usize| (users < WRITER - 1).then(|| users + 1);
        self.users.fetch_update(Ordering::Acquire, Ordering::Relaxed, enter).map_err(|_| busy())?;
        let _reading = Reading(&self.users);
        // SAFETY: no call changes the asset while readers are counted.
        body(unsafe { &*self.asset.get() })
    }

    /// For calls that change or build anything.
    pub fn write<R>(self: &Arc<Self>, body: impl FnOnce(&mut Asset) -> Outcome<R>) -> Outcome<R> {
        body(self.claim()?.asset())
    }

    /// Claims the asset for exclusive use by one call or job.
    pub fn claim(self: &Arc<Self>) -> Outcome<Claim> {
        self.users
            .compare_exchange(0, WRITER, Ordering::Acquire, Ordering::Relaxed)
            .map(|_| Claim(self.clone()))
            .map_err(|_| busy())
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
        // SAFETY: only one claim exists at a time, without readers, and the asset is borrowed as long as the claim.
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
        self.0.users.store(0, Ordering::Release);
    }
}

fn busy() -> Failure {
    Failure::new(VRTM_ERROR_BUSY, "asset: another call, or a job, is using it")
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
    fn an_asset_in_use_is_busy_and_never_waits() {
        let asset = triangle();
        let inner = asset.write(|_| {
            assert_eq!(asset.read(|_| Ok(())).unwrap_err().status, VRTM_ERROR_BUSY);
            Ok(asset.write(|_| Ok(())).unwrap_err().status)
        });
        assert_eq!(inner.unwrap(), VRTM_ERROR_BUSY);
        // Readers do not block each other, and a writer fails instead of waiting for them.
        let inner = asset.read(|_| {
            assert!(asset.read(|_| Ok(())).is_ok());
            Ok(asset.write(|_| Ok(())).unwrap_err().status)
        });
        assert_eq!(inner.unwrap(), VRTM_ERROR_BUSY);
        assert!(asset.write(|_| Ok(())).is_ok());
    }

    #[test]
    fn an_asset_survives_a_panic() {
        let asset = triangle();
        let status = guard("vrtm_test", || asset.write(|_| -> Outcome<()> { panic!("in the middle") }));
        assert_eq!(status, VRTM_ERROR_INTERNAL);
        assert_eq!(asset.read(|asset| Ok(asset.tile_count())).unwrap(), 1);
        assert!(asset.write(|asset| Ok(asset.set_rigidity(0, None)?)).is_ok());
    }
}
