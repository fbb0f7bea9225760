//! A Rust program has its own global allocator and its own panic hook. Solves use the one and leave the other alone.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ffi::c_void;
use std::panic::{catch_unwind, set_hook, take_hook};
use std::ptr::null_mut;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use vrtm::{
    Asset, Backend, Device, DeviceSettings, ErrorKind, HostAllocator, ImageLayout, ImageView, MeshSource,
    PixelFormat, SolveOptions, Strided, UvSource, adapters,
};

/// The system's allocator, which counts what is taken.
struct Counting;

static BYTES: AtomicUsize = AtomicUsize::new(0);

// SAFETY: all calls go to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        BYTES.fetch_add(layout.size(), Ordering::Relaxed);
        // SAFETY: passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: passed on.
        unsafe { System.dealloc(block, layout) }
    }
}

/// It does not compile beside another one.
#[global_allocator]
static ALLOCATOR: Counting = Counting;

const REST: [[f32; 3]; 6] =
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0]];

/// Two squares, of which one is stretched.
fn solve(backend: Backend) -> vrtm::Result<()> {
    let uvs = REST.map(|[x, y, _]| [x / 2.0, y]);
    let corners = [0, 1, 4, 3, 1, 2, 5, 4];
    let device = Device::new(&DeviceSettings { backend, ..DeviceSettings::default() })?;
    let mut asset = Asset::new(
        &device,
        &MeshSource {
            positions: Strided::from_slice(&REST),
            face_counts: Some(&[4, 4]),
            indices: &corners,
            uvs: UvSource { u: Strided::from_slice(&uvs), v: None, indices: Some(&corners) },
            ..MeshSource::default()
        },
    )?;
    let mut painted = [0u8; 32 * 32];
    painted.chunks_exact_mut(32).skip(12).take(8).for_each(|row| row[12..20].fill(255));
    let layout = ImageLayout::packed(32, 32, PixelFormat::U8);
    asset.tile_mut(0).set_rigidity(Some(ImageView::new("rigidity", &painted, layout)?))?;
    let mut pose = REST;
    (pose[1][0], pose[4][0]) = (1.3, 1.3);
    asset.solve(Strided::from_slice(&pose), &SolveOptions::default())?;
    let report = asset.tile(0).report()?;
    assert!(report.energy < report.energy_before && report.min_jacobian > 0.0);
    Ok(())
}

unsafe extern "C" fn no_memory(_: *mut c_void, _: usize, _: usize) -> *mut c_void {
    null_mut()
}

unsafe extern "C" fn takes_nothing_back(_: *mut c_void, _: *mut c_void, _: usize, _: usize) {}

#[test]
fn a_program_keeps_its_allocator_and_its_panic_hook() {
    let panics = Arc::new(AtomicUsize::new(0));
    let counter = panics.clone();
    let hook: Box<dyn Fn(&std::panic::PanicHookInfo<'_>) + Sync + Send> = Box::new(move |_| {
        counter.fetch_add(1, Ordering::Relaxed);
    });
    let place = (&raw const *hook).cast::<()>();
    set_hook(hook);

    let mut backends = vec![Backend::Cpu];
    if !adapters().is_empty() {
        backends.push(Backend::Gpu);
    }
    for backend in backends {
        let before = BYTES.load(Ordering::Relaxed);
        solve(backend).unwrap();
        let taken = BYTES.load(Ordering::Relaxed) - before;
        println!("{backend:?}: {taken} bytes");
        assert!(taken > 10_000, "only {taken} bytes came from the program's allocator");
    }

    // A host's allocator takes the library's own global one.
    // SAFETY: the functions fit each other.
    let allocator = Some(unsafe { HostAllocator::new(no_memory, takes_nothing_back, null_mut()) });
    let error = Device::new(&DeviceSettings { allocator, ..DeviceSettings::default() }).unwrap_err();
    assert_eq!(error.kind, ErrorKind::Unsupported);

    // It is the hook of above, and none that passes panics on to it.
    assert_eq!(panics.load(Ordering::Relaxed), 0);
    assert!(catch_unwind(|| panic!("the program's own")).is_err());
    assert_eq!(panics.load(Ordering::Relaxed), 1);
    let hook = take_hook();
    assert_eq!((&raw const *hook).cast::<()>(), place);
}
