use std::alloc::{GlobalAlloc, Layout, System};
use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use vrtm_core::allocation::current::Current;
use vrtm_core::allocation::global::Allocator;
use vrtm_core::allocation::host::HostAllocator;
use vrtm_core::allocation::vec;
use vrtm_core::allocation::vec::Vec;
use vrtm_core::allocation::*;
use vrtm_core::error::{ErrorKind, Result};
use vrtm_core::team::Team;
use vrtm_core::unwind::{Stop, caught, why};

/// The size of the largest blocks. Miri looks at each byte by itself.
const LARGEST: usize = if cfg!(miri) { 50_000 } else { 1 << 20 };

/// A host's allocator that counts, and fails on demand.
#[derive(Default)]
struct Host {
    blocks: AtomicUsize,
    bytes: AtomicUsize,
    fails: AtomicBool,
}

unsafe extern "C" fn alloc(user: *mut c_void, size: usize, alignment: usize) -> *mut c_void {
    // SAFETY: `user` is the allocator's host, which outlives it.
    let host = unsafe { &*user.cast::<Host>() };
    assert!(size >= global::LARGE && alignment >= 16 && alignment.is_power_of_two());
    if host.fails.load(Ordering::Relaxed) {
        return std::ptr::null_mut();
    }
    host.blocks.fetch_add(1, Ordering::Relaxed);
    host.bytes.fetch_add(size, Ordering::Relaxed);
    let layout = Layout::from_size_align(size, alignment).unwrap();
    // SAFETY: the layout is not empty. The memory is filled, as zeros are not promised.
    unsafe {
        let block = System.alloc(layout);
        block.write_bytes(0xa5, size);
        block.cast()
    }
}

unsafe extern "C" fn free(user: *mut c_void, pointer: *mut c_void, size: usize, alignment: usize) {
    // SAFETY: as above.
    let host = unsafe { &*user.cast::<Host>() };
    host.blocks.fetch_sub(1, Ordering::Relaxed);
    host.bytes.fetch_sub(size, Ordering::Relaxed);
    // SAFETY: the block comes from `alloc`.
    unsafe { System.dealloc(pointer.cast(), Layout::from_size_align(size, alignment).unwrap()) };
}

impl Host {
    fn allocator(&self) -> HostAllocator {
        let user = (&raw const *self).cast_mut().cast();
        // SAFETY: the functions match, and every test drops its allocations before the host.
        unsafe { HostAllocator::new(alloc, free, user) }
    }

    fn current(&self) -> Current {
        Current::new(Some(&self.allocator()))
    }

    fn in_use(&self) -> (usize, usize) {
        (self.blocks.load(Ordering::Relaxed), self.bytes.load(Ordering::Relaxed))
    }
}

fn bytes_missing<R>(f: impl FnOnce() -> R) -> u64 {
    let payload = catch_unwind(AssertUnwindSafe(f)).err().expect("memory is missing");
    let Some(Stop::OutOfMemory(bytes)) = why(&*payload) else { panic!("a panic") };
    bytes
}

#[test]
fn blocks_are_aligned_and_go_back_to_where_they_came_from() {
    let host = Host::default();
    for with_host in [false, true] {
        for size in [1, 100, 4095, 4096, 5000, LARGEST] {
            for alignment in [1, 2, 8, 16, 32, 64, 128, 1024, 4096] {
                let layout = Layout::from_size_align(size, alignment).unwrap();
                let scope = with_host.then(|| host.current().enter());
                for zeroed in [false, true] {
                    // SAFETY: the block is used within its size, and freed with its layout.
                    unsafe {
                        let block =
                            if zeroed { Allocator.alloc_zeroed(layout) } else { Allocator.alloc(layout) };
                        assert!(!block.is_null() && block.addr().is_multiple_of(alignment));
                        let bytes = std::slice::from_raw_parts_mut(block, size);
                        assert!(!zeroed || bytes.iter().all(|byte| *byte == 0));
                        bytes.fill(1);
                        let from_host = with_host && size >= global::LARGE;
                        assert_eq!(host.in_use().0, usize::from(from_host), "{size} {alignment}");
                        Allocator.dealloc(block, layout);
                    }
                    assert_eq!(host.in_use(), (0, 0));
                }
                drop(scope);
            }
        }
    }
}

#[test]
fn a_block_keeps_its_bytes_when_it_crosses_the_limit() {
    let host = Host::default();
    let sizes = [16, 4095, 4096, 4097, LARGEST / 10, 5000, 4096, 4095, 16, LARGEST, 1];
    for alignment in [1, 16, 64, 4096] {
        // The current allocator changes between the steps.
        for pattern in 0..4usize {
            let mut layout = Layout::from_size_align(8, alignment).unwrap();
            // SAFETY: the block is used within its size, and freed with its layout.
            unsafe {
                let mut block = Allocator.alloc(layout);
                block.write_bytes(7, 8);
                for (k, size) in sizes.into_iter().enumerate() {
                    let with_host = [false, true, k % 2 == 0, k % 3 == 0][pattern];
                    let scope = with_host.then(|| host.current().enter());
                    let common = layout.size().min(size);
                    block = Allocator.realloc(block, layout, size);
                    drop(scope);
                    layout = Layout::from_size_align(size, alignment).unwrap();
                    assert!(!block.is_null() && block.addr().is_multiple_of(alignment));
                    let bytes = std::slice::from_raw_parts_mut(block, size);
                    assert!(bytes[..common].iter().all(|byte| *byte == 7), "{alignment} {pattern} {k}");
                    bytes.fill(7);
                    if size >= global::LARGE && pattern < 2 {
                        assert_eq!(host.in_use().0, usize::from(with_host));
                    }
                }
                Allocator.dealloc(block, layout);
            }
            assert_eq!(host.in_use(), (0, 0));
        }
    }
}

#[test]
fn a_block_that_cannot_move_shrinks_where_it_is() {
    let host = Host::default();
    let mut array = {
        let _scope = host.current().enter();
        vec![3u8; 100_000]
    };
    array.truncate(10_000);
    host.fails.store(true, Ordering::Relaxed);
    let before = array.as_ptr();
    {
        // The scope of the host's allocator is active here, too.
        let _scope = host.current().enter();
        let _fallible = current::Fallible::enter();
        array.shrink_to_fit();
    }
    assert_eq!((array.capacity(), array.as_ptr()), (10_000, before));
    assert!(array.iter().all(|x| *x == 3) && host.in_use().1 > 100_000);
    drop(array);
    assert_eq!(host.in_use(), (0, 0));
}

#[test]
fn any_thread_frees_at_any_time() {
    let host = Host::default();
    let arrays = {
        let _scope = host.current().enter();
        [zeroed::<u64>(1000), vec![1u64; 2000]]
    };
    assert_eq!(host.in_use().0, 2);
    // The handle is gone; the blocks keep the record with their `free`.
    std::thread::spawn(move || drop(arrays)).join().unwrap();
    assert_eq!(host.in_use(), (0, 0));
}

#[test]
fn missing_memory_unwinds_with_its_size_or_comes_from_the_system() {
    let host = Host::default();
    host.fails.store(true, Ordering::Relaxed);
    let _scope = host.current().enter();
    assert_eq!(bytes_missing(|| zeroed::<u32>(5000)), 20_000);
    assert_eq!(bytes_missing(|| vec![[1.0f64; 2]; 1000]), 16_000);
    assert_eq!(bytes_missing(|| (0..3000u32).collect::<Vec<_>>()), 12_000);
    assert_eq!(bytes_missing(|| boxed([0u8; 9000])), 9000);
    assert!(bytes_missing(|| (0..10_000u32).filter(|x| x % 2 == 0).collect::<Vec<_>>()) >= 2048);
    let mut table = std::collections::HashMap::<u32, u32>::new();
    assert!(bytes_missing(|| make_room_in(&mut table, 1000)) >= 8000);
    // Allocations by the standard library itself are infallible.
    let array = std::vec::Vec::<u8>::with_capacity(100_000);
    assert!(array.capacity() >= 100_000 && host.in_use() == (0, 0));
    let error = caught(|| Ok(zeroed::<u8>(7000))).unwrap_err();
    assert_eq!(
        (error.kind, &*error.message),
        (ErrorKind::OutOfMemory, "out of memory: 7000 bytes could not be had")
    );
    // Other panics pass through.
    let panic = catch_unwind(|| caught(|| -> Result<()> { panic!("seven") })).unwrap_err();
    assert_eq!(panic.downcast_ref(), Some(&"seven"));
}

#[test]
fn sizes_beyond_all_memory_are_missing_memory() {
    for count in [usize::MAX, usize::MAX / 2, usize::MAX / 8 + 1, 1 << 60] {
        assert!(bytes_missing(|| zeroed::<u64>(count)) > 1 << 59);
        assert!(bytes_missing(|| vec![1u64; count]) > 1 << 59);
        assert!(bytes_missing(|| Vec::<u64>::with_capacity(count)) > 1 << 59);
        let mut array = vec![1u64, 2];
        assert!(bytes_missing(|| array.resize(count, 3)) > 1 << 59);
        assert!(bytes_missing(|| array.reserve(count)) > 1 << 59);
        assert_eq!(array, [1, 2]);
    }
}

#[test]
fn arrays_grow_as_those_of_std_do() {
    let mut array = Vec::with_capacity(2);
    (0..1000u32).for_each(|x| array.push(x));
    array.insert(0, 7);
    array.extend([8, 9]);
    array.extend((0..10).filter(|x| x % 2 == 1));
    array.resize(1010, 6);
    let mut expected = vec![7];
    expected.extend((0..1000).chain([8, 9, 1, 3, 5, 7, 9, 6, 6]));
    assert_eq!(array, expected);
    assert_eq!((0..5).chain(8..10).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 8, 9]);
    assert_eq!(*boxed([7u64; 3]), [7; 3]);
    boxed(());
    assert_eq!(zeroed::<[u16; 3]>(2), [[0; 3]; 2]);
    assert!(zeroed::<f32>(0).is_empty());
}

#[test]
fn helpers_of_a_team_work_with_its_caller_s_memory() {
    let host = Host::default();
    for threads in [1, 4] {
        let _scope = host.current().enter();
        let arrays = Team::with(threads, |team| team.map(64, |k| vec![k; 1000]));
        assert!(host.in_use().0 >= 64);
        drop(arrays);
        host.fails.store(true, Ordering::Relaxed);
        let missing = bytes_missing(|| {
            Team::with(threads, |team| team.run(64, |k| drop(vec![k as u8; 5000])));
        });
        assert_eq!(missing, 5000);
        host.fails.store(false, Ordering::Relaxed);
    }
    assert_eq!(host.in_use(), (0, 0));
}

#[test]
fn the_reserve_is_used_and_given_back() {
    let layout = |size, alignment| Layout::from_size_align(size, alignment).unwrap();
    let before = emergency::taken();
    let mut blocks = Vec::new();
    for alignment in [1, 16, 64, 128, 4096] {
        for size in [1, 64, 65, 1000] {
            let block = emergency::alloc(layout(size, alignment));
            assert!(emergency::holds(block) && block.addr().is_multiple_of(alignment));
            // SAFETY: the block has this size.
            unsafe { block.write_bytes(blocks.len() as u8, size) };
            blocks.push((block, layout(size, alignment)));
        }
    }
    assert!(emergency::taken() > before);
    for (k, (block, layout)) in blocks.into_iter().enumerate() {
        // SAFETY: the block has this size, and is freed with its layout.
        unsafe {
            assert!((0..layout.size()).all(|at| block.add(at).read() == k as u8), "{k}");
            // Every second block moves to the system's memory first.
            if k % 2 == 0 {
                Allocator.dealloc(block, layout);
            } else {
                let moved = Allocator.realloc(block, layout, 3000);
                assert!(!emergency::holds(moved) && moved.read() == k as u8);
                Allocator.dealloc(moved, Layout::from_size_align(3000, layout.align()).unwrap());
            }
        }
    }
    assert_eq!(emergency::taken(), before);
    // The reserve is finite.
    assert!(emergency::alloc(layout(1 << 20, 1)).is_null());
    let mut taken = Vec::new();
    loop {
        let block = emergency::alloc(layout(10_000, 1));
        if block.is_null() {
            break;
        }
        taken.push(block);
    }
    assert!(taken.len() >= 20);
    // SAFETY: as above.
    taken.into_iter().for_each(|block| unsafe { emergency::free(block, 10_000) });
    assert_eq!(emergency::taken(), before);
}
