//! Calls of several threads to the same assets: solves, jobs, cancels, reads in the middle of solves, changes, and
//! assets that are destroyed meanwhile. The threads share handles by relaxed atomics alone, so that nothing but the
//! library orders what they do.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use vrtm_capi::{
    asset::*, device::*, fetch::*, handle::*, job::*, map::*, prepare::*, refine::*, report::*, solve::*,
    status::*, tile::*, types::*,
};

use crate::host::*;

const THREADS: usize = 4;
/// The assets, and the calls of each thread. Few for Miri, which takes up to a minute for a solve.
const ASSETS: usize = if cfg!(miri) { 1 } else { 3 };
const CALLS: usize = if cfg!(miri) { 3 } else { 400 };

/// A linear congruential generator, whose high bits are random enough.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % n
    }
}

/// Handles, also of what is gone.
struct Shared {
    device: vrtm_device,
    assets: [AtomicU64; ASSETS],
    tiles: [AtomicU64; ASSETS],
    jobs: [AtomicU64; ASSETS],
    /// Calls by status.
    statuses: [AtomicUsize; 16],
}

impl Shared {
    fn make(&self, k: usize) {
        let (asset, [tile, _]) = asset(self.device);
        self.tiles[k].store(tile.id, Ordering::Relaxed);
        self.assets[k].store(asset.id, Ordering::Relaxed);
    }

    /// One call of a random function to a random asset.
    fn call(&self, random: &mut Random) -> vrtm_status {
        let k = random.below(ASSETS);
        let asset = vrtm_asset { id: self.assets[k].load(Ordering::Relaxed) };
        let tile = vrtm_tile { id: self.tiles[k].load(Ordering::Relaxed) };
        let job = vrtm_job { id: self.jobs[k].load(Ordering::Relaxed) };
        let mut bent = pose(0.1 * random.below(6) as f32);
        let options = vrtm_solve_options {
            solver: [VRTM_SOLVER_DESCENT, VRTM_SOLVER_PBD][random.below(2)],
            warm: random.below(2) as u32,
            measure: random.below(2) as u32,
            release: random.below(2) as u32,
            ..least()
        };
        let image = Image::new(VRTM_PIXEL_F32, 2);
        // SAFETY: all pointers point to memory of the size that the structs tell; any handle may be given.
        unsafe {
            match random.below(20) {
                0..3 => vrtm_asset_solve(asset, &bent.c(), &options),
                3..6 => {
                    let mut job = vrtm_job { id: 0 };
                    let options = vrtm_solve_options { replace: random.below(2) as u32, ..options };
                    let status = vrtm_asset_submit(asset, &bent.c(), &options, &mut job);
                    if status == VRTM_OK {
                        let before = self.jobs[k].swap(job.id, Ordering::Relaxed);
                        vrtm_job_destroy(vrtm_job { id: before });
                    }
                    status
                }
                6 => vrtm_job_wait(job, [0, 1, VRTM_FOREVER][random.below(3)]),
                7 => vrtm_job_cancel(job),
                8 => vrtm_job_get_progress(job, &mut sized()),
                9 => vrtm_asset_cancel(asset),
                10 => vrtm_asset_fetch(&vrtm_fetch { tile, image: &image.c, ..sized() }, 1),
                11 => {
                    let fetch = vrtm_fetch { kind: VRTM_FETCH_WARP, tile, image: &image.c, ..sized() };
                    vrtm_asset_redirect(asset, &bent.c(), &options, &fetch, 1)
                }
                12 => vrtm_asset_fetch_corner_uvs(asset, 0, [0.0; 2 * CORNERS].as_mut_ptr(), CORNERS),
                13 => vrtm_tile_get_report(tile, &mut sized()),
                14 => vrtm_asset_get_report(asset, &mut sized()),
                15 => vrtm_tile_get_info(tile, &mut sized()),
                16 => {
                    let map = vrtm_map_desc { width: 8, height: 8, ..sized() };
                    vrtm_tile_inspect_map(tile, &map, &mut sized())
                }
                17 => {
                    let mut size = 0;
                    vrtm_tile_save(tile, std::ptr::null_mut(), 0, &mut size)
                }
                18 => {
                    let mut refinement = vrtm_refinement { id: 0 };
                    let desc = vrtm_refinement_desc { max_triangles: 40, ..vrtm_refinement_desc::default() };
                    let status = vrtm_refinement_create(asset, &desc, &mut refinement);
                    vrtm_refinement_extend(refinement);
                    vrtm_refinement_destroy(refinement);
                    status
                }
                _ => {
                    let status = vrtm_asset_destroy(asset);
                    if status == VRTM_OK {
                        self.make(k);
                    }
                    status
                }
            }
        }
    }
}

#[test]
fn threads_that_share_assets() {
    let desc = vrtm_device_desc { backend: VRTM_BACKEND_CPU, threads: 2, ..vrtm_device_desc::default() };
    let mut device = vrtm_device { id: 0 };
    // SAFETY: both point to valid values.
    done(unsafe { vrtm_device_create(&desc, &mut device) });
    let shared = Shared {
        device,
        assets: Default::default(),
        tiles: Default::default(),
        jobs: Default::default(),
        statuses: Default::default(),
    };
    (0..ASSETS).for_each(|k| shared.make(k));
    std::thread::scope(|scope| {
        for seed in 0..THREADS {
            let shared = &shared;
            scope.spawn(move || {
                let random = &mut Random(seed as u64);
                for _ in 0..CALLS {
                    let status = shared.call(random);
                    shared.statuses[status as usize].fetch_add(1, Ordering::Relaxed);
                }
            });
        }
    });
    // How many calls meet a busy or destroyed asset depends on the machine.
    println!("calls by status: {:?}", shared.statuses);
    let count = |status: vrtm_status| shared.statuses[status as usize].load(Ordering::Relaxed);
    let expected = [
        VRTM_OK,
        VRTM_ERROR_INVALID_HANDLE,
        VRTM_ERROR_NOT_SOLVED,
        VRTM_ERROR_BUSY,
        VRTM_ERROR_CANCELLED,
        VRTM_ERROR_TIMEOUT,
    ];
    assert_eq!(expected.map(count).iter().sum::<usize>(), THREADS * CALLS, "{:?}", shared.statuses);
    assert!(count(VRTM_OK) > 0);
    for k in 0..ASSETS {
        let asset = vrtm_asset { id: shared.assets[k].load(Ordering::Relaxed) };
        // SAFETY: any handle may be given; all pointers point to memory of the size that the structs tell.
        unsafe {
            vrtm_job_destroy(vrtm_job { id: shared.jobs[k].load(Ordering::Relaxed) });
            done(vrtm_asset_solve(asset, &pose(0.5).c(), &least()));
            done(vrtm_asset_destroy(asset));
        }
    }
    // SAFETY: as above.
    done(unsafe { vrtm_device_destroy(device) });
}
