//! What a frame costs beside its arithmetic: allocations. They are counted, not timed, so that the bounds hold on any
//! machine.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ffi::c_void;
use std::num::NonZeroU32;
use std::sync::atomic::{AtomicU64, Ordering};

use vrtm::{
    Asset, Backend, Device, DeviceSettings, Fetch, FetchKind, HostAllocator, ImageLayout, ImageViewMut,
    PixelFormat, SolveOptions, Strided,
};
use vrtm_testkit::sixteen::{bulged, discs, sixteen_asset, sixteen_charts};
use vrtm_testkit::{set_grid, view};

static CALLS: AtomicU64 = AtomicU64::new(0);

unsafe extern "C" fn alloc(_: *mut c_void, size: usize, alignment: usize) -> *mut c_void {
    CALLS.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the layout is not empty.
    unsafe { System.alloc(Layout::from_size_align(size, alignment).unwrap()).cast() }
}

unsafe extern "C" fn free(_: *mut c_void, pointer: *mut c_void, size: usize, alignment: usize) {
    // SAFETY: from `alloc`, for this layout.
    unsafe { System.dealloc(pointer.cast(), Layout::from_size_align(size, alignment).unwrap()) }
}

/// Allocations while `f` runs.
fn during(f: impl FnOnce()) -> u64 {
    let before = CALLS.load(Ordering::Relaxed);
    f();
    CALLS.load(Ordering::Relaxed) - before
}

/// One frame: a pose, and its map.
fn redirect(asset: &mut Asset, pose: &[[f32; 3]], bytes: &mut [u8]) {
    let image = ImageViewMut::new("image", bytes, ImageLayout::packed(256, 256, PixelFormat::F32)).unwrap();
    let fetch = Fetch::Image { tile: 0, kind: FetchKind::Redirection, image };
    asset.redirect(Strided::from_slice(pose), &SolveOptions::default(), &mut [fetch]).unwrap();
}

#[test]
fn a_frame_allocates_little() {
    for threads in [1, 2] {
        // SAFETY: the functions are those of the system's allocator.
        let allocator = Some(unsafe { HostAllocator::new(alloc, free, std::ptr::null_mut()) });
        let threads = NonZeroU32::new(threads);
        let settings = DeviceSettings { backend: Backend::Cpu, threads, allocator, ..Default::default() };
        let mut asset = sixteen_asset(&Device::new(&settings).unwrap(), 0.9).unwrap();
        asset.tile_mut(0).set_rigidity(Some(view(&discs(256, 32), 256, 256))).unwrap();
        set_grid(&mut asset, 256);
        let (rest, ..) = sixteen_charts(0.9);
        let [first, second] = [1.0, 0.9].map(|strength| bulged(&rest, strength));
        let mut bytes = vec![0; 256 * 256 * 8];
        let [of_first, of_next, of_same] =
            [&first, &second, &second].map(|pose| during(|| redirect(&mut asset, pose, &mut bytes)));
        println!(
            "{of_first} in the first frame, {of_next} in the next one, {of_same} for the same pose again"
        );
        assert!(of_first < 5000 && of_next < 200 && of_same < 100, "{of_first}, {of_next}, {of_same}");
    }
}
