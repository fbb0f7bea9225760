//! An asset shared by several threads. Constant data and results can be read at any time; all else is used by one call
//! at a time. Others fail as busy instead of waiting, since a callback that calls into the asset would wait for itself.

use std::cell::UnsafeCell;
use std::sync::{Arc, Condvar, Mutex, PoisonError};

use super::status::{Failure, Outcome, VRTM_ERROR_BUSY};
use vrtm::{Asset, Device, Results};
use vrtm_core::control::{Control, is_lent};
use vrtm_core::local;
use vrtm_core::panics::lock;
use vrtm_core::report::AssetInfo;

/// An asset shared by threads.
pub(super) struct SharedAsset {
    /// Facts about the mesh.
    pub info: AssetInfo,
    pub device: Device,
    pub results: Results,
    asset: UnsafeCell<Asset>,
    usage: Mutex<Usage>,
    /// Notified when a solve is announced, and when the asset is released.
    changed: Condvar,
}

#[derive(Default)]
struct Usage {
    is_claimed: bool,
    /// The solve in progress, unless it was cancelled.
    solve: Option<Arc<dyn Solve>>,
    /// The number of calls that have waited to replace a solve, and of those that have had their turn.
    waited: u64,
    served: u64,
    /// True once the handle was destroyed.
    ended: bool,
}

/// A call or a job that solves.
pub(super) trait Solve: Send + Sync {
    /// Makes it end soon, if it has no result yet.
    fn cancel(&self);
}

impl Solve for Control {
    fn cancel(&self) {
        Control::cancel(self);
    }
}

// SAFETY: `asset` is reached through its one `Claim` alone.
unsafe impl Sync for SharedAsset {}

impl SharedAsset {
    pub fn new(asset: Asset) -> SharedAsset {
        SharedAsset {
            info: asset.info(),
            device: asset.device().clone(),
            results: asset.results().clone(),
            asset: UnsafeCell::new(asset),
            usage: Mutex::default(),
            changed: Condvar::new(),
        }
    }

    /// Calls `body` with the asset, of which it has exclusive use.
    pub fn write<R>(self: &Arc<Self>, body: impl FnOnce(&mut Asset) -> Outcome<R>) -> Outcome<R> {
        body(self.claim()?.asset())
    }

    /// Claims the asset for exclusive use by one call or job.
    pub fn claim(self: &Arc<Self>) -> Outcome<Claim> {
        let mut usage = lock(&self.usage);
        if usage.is_claimed {
            return Err(Failure::new(VRTM_ERROR_BUSY, "asset: another call, or a job, is using it"));
        }
        usage.is_claimed = true;
        Ok(Claim(self.clone()))
    }

    /// Claims the asset for the newest solve: cancels the one in progress and waits for its end, each caller in its
    /// turn. A thread within another call of the library, which may be the one to wait for, does not wait.
    pub fn claim_next(self: &Arc<Self>) -> Outcome<Claim> {
        if local::with(|local| local.depth.get()) > 1 || is_lent() {
            return self.claim();
        }
        let mut usage = lock(&self.usage);
        let turn = usage.waited;
        usage.waited += 1;
        while usage.is_claimed || usage.served < turn {
            if let Some(solve) = usage.solve.take() {
                // A job that no thread has begun ends here, and releases the asset.
                drop(usage);
                solve.cancel();
                usage = lock(&self.usage);
            } else {
                usage = self.changed.wait(usage).unwrap_or_else(PoisonError::into_inner);
            }
        }
        usage.served += 1;
        usage.is_claimed = true;
        Ok(Claim(self.clone()))
    }

    /// Registers the solve that the asset is claimed for, so that others can cancel it, even before it begins.
    pub fn announce(&self, solve: Arc<dyn Solve>) {
        let mut usage = lock(&self.usage);
        if usage.ended {
            drop(usage);
            return solve.cancel();
        }
        usage.solve = Some(solve);
        self.changed.notify_all();
    }

    /// Cancels the solve in progress, if any.
    pub fn cancel(&self) {
        let solve = lock(&self.usage).solve.take();
        solve.inspect(|solve| solve.cancel());
    }

    /// Called when the handle is destroyed: cancels the solve in progress and all later ones.
    pub fn end(&self) {
        lock(&self.usage).ended = true;
        self.cancel();
    }
}

/// Exclusive use of an asset by one call or job until it is dropped. Keeps the asset alive.
pub(super) struct Claim(Arc<SharedAsset>);

impl Claim {
    pub fn asset(&mut self) -> &mut Asset {
        // SAFETY: only one claim exists at a time, and the asset is borrowed as long as the claim.
        unsafe { &mut *self.0.asset.get() }
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        let mut usage = lock(&self.0.usage);
        let ended = usage.solve.take();
        usage.is_claimed = false;
        self.0.changed.notify_all();
        // It may be the last owner of a job.
        drop((usage, ended));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;
    use std::thread;

    use super::super::guard::guard;
    use super::super::status::VRTM_ERROR_INTERNAL;
    use super::*;
    use vrtm::Device;
    use vrtm_core::fixtures;
    use vrtm_core::settings::DeviceSettings;

    fn square() -> Arc<SharedAsset> {
        let device = Device::new(&DeviceSettings::default()).unwrap();
        Arc::new(SharedAsset::new(Asset::new(&device, &fixtures::square().1).unwrap()))
    }

    #[test]
    fn newer_solves_replace_older_ones_in_turn() {
        struct Tells(u32, mpsc::Sender<u32>);
        impl Solve for Tells {
            fn cancel(&self) {
                self.1.send(self.0).unwrap();
            }
        }
        let (asset, (tell, cancelled)) = (square(), mpsc::channel());
        let announce = |number| asset.announce(Arc::new(Tells(number, tell.clone())));
        let mut claim = asset.claim().unwrap();
        announce(0);
        let next = |number| {
            let claim = asset.claim_next().unwrap();
            announce(number);
            claim
        };
        thread::scope(|scope| {
            // Each is cancelled while it has the asset, which the next one gets once it has ended.
            let mut waiting = scope.spawn(|| next(1));
            for number in 0..3 {
                assert_eq!(cancelled.recv(), Ok(number));
                assert!(asset.claim().is_err() && !waiting.is_finished());
                let newer = scope.spawn(move || next(number + 2));
                drop(claim);
                claim = waiting.join().unwrap();
                waiting = newer;
            }
            assert_eq!(cancelled.recv(), Ok(3));
            drop(claim);
        });
    }

    #[test]
    fn an_asset_survives_a_panic() {
        let asset = square();
        let status = guard("vrtm_test", || asset.write(|_| -> Outcome<()> { panic!("in the middle") }));
        assert_eq!(status, VRTM_ERROR_INTERNAL);
        assert!(asset.write(|asset| Ok(asset.tile_mut(0).set_rigidity(None)?)).is_ok());
    }
}
