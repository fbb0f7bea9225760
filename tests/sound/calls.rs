//! The C functions, called as a host does that keeps to their contract by a byte: every array and image is as large as
//! its struct says, at an odd address where that is allowed, and freed after the call.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ffi::c_void;
use std::ptr;
use std::sync::atomic::{AtomicIsize, AtomicPtr, Ordering};

use vrtm_capi::{
    allocator::*, asset::*, carrier::*, device::*, dilation::*, executor::*, fetch::*, handle::*, job::*,
    map::*, prepare::*, refine::*, report::*, solve::*, tile::*, types::*,
};

use crate::host::*;

unsafe extern "C" fn alloc(blocks: *mut c_void, size: usize, alignment: usize) -> *mut c_void {
    // SAFETY: the count outlives the device; the layout is as the header tells.
    unsafe {
        (*blocks.cast::<AtomicIsize>()).fetch_add(1, Ordering::Relaxed);
        System.alloc(Layout::from_size_align(size, alignment).unwrap()).cast()
    }
}

unsafe extern "C" fn free(blocks: *mut c_void, pointer: *mut c_void, size: usize, alignment: usize) {
    // SAFETY: as above.
    unsafe {
        (*blocks.cast::<AtomicIsize>()).fetch_sub(1, Ordering::Relaxed);
        System.dealloc(pointer.cast(), Layout::from_size_align(size, alignment).unwrap());
    }
}

/// A host's threads.
unsafe extern "C" fn parallel_for(_: *mut c_void, count: usize, task: vrtm_task_fn, data: *mut c_void) {
    let (task, data) = (task.unwrap(), AtomicPtr::new(data));
    let data = &data;
    std::thread::scope(|scope| {
        for index in 0..count {
            // SAFETY: the task may be called on any thread before this returns.
            scope.spawn(move || unsafe { task(data.load(Ordering::Relaxed), index) });
        }
    });
}

unsafe extern "C" fn progress(calls: *mut c_void, done: f32) -> u32 {
    assert!((0.0..=1.0).contains(&done));
    // SAFETY: the number outlives the call, which alone uses it.
    unsafe { *calls.cast::<u32>() += 1 };
    0
}

fn device(threads: u32) -> vrtm_device {
    let desc = vrtm_device_desc { backend: VRTM_BACKEND_CPU, threads, ..vrtm_device_desc::default() };
    let mut device = vrtm_device { id: 0 };
    // SAFETY: both point to valid values.
    done(unsafe { vrtm_device_create(&desc, &mut device) });
    device
}

fn end(device: vrtm_device, asset: vrtm_asset) {
    // SAFETY: any handle may be given.
    unsafe {
        done(vrtm_asset_destroy(asset));
        done(vrtm_device_destroy(device));
    }
}

#[test]
fn a_solve_and_its_outputs() {
    let device = device(1);
    let (asset, tiles) = asset(device);
    let mut bent = pose(0.5);
    let bent = bent.c();
    let mut calls = 0u32;
    let options = vrtm_solve_options {
        measure: 1,
        progress: Some(progress),
        progress_user: (&raw mut calls).cast(),
        ..least()
    };
    // SAFETY: all pointers point to memory of the size that the structs tell.
    unsafe {
        let vertices: Vec<[f32; 1]> = (0..VERTICES).map(|k| [(k % 2) as f32]).collect();
        done(vrtm_asset_set_vertex_rigidity(asset, &Array::new(&vertices).c()));
        done(vrtm_asset_set_vertex_rigidity(asset, ptr::null()));
        done(vrtm_asset_solve(asset, &bent, &options));
        assert!(calls > 0);
        let outputs = [
            (VRTM_FETCH_REDIRECTION, VRTM_PIXEL_F32, 4),
            (VRTM_FETCH_REDIRECTION_DELTA, VRTM_PIXEL_F16, 2),
            (VRTM_FETCH_WARP, VRTM_PIXEL_F32, 3),
            (VRTM_FETCH_REDIRECTION_UDIM, VRTM_PIXEL_F32, 3),
            (VRTM_FETCH_JACOBIAN, VRTM_PIXEL_F16, 4),
            (VRTM_FETCH_FILTER_SCALE, VRTM_PIXEL_F32, 1),
            (VRTM_FETCH_UV_SET_DELTA, VRTM_PIXEL_F32, 2),
        ];
        for (kind, format, channels) in outputs {
            let image = Image::new(format, channels);
            let fetch = vrtm_fetch { kind, tile: tiles[0], image: &image.c, ..sized() };
            done(vrtm_asset_fetch(&fetch, 1));
            image.check();
        }
        let image = Image::new(VRTM_PIXEL_F32, 2);
        let mut fetch = vrtm_fetch { tile: tiles[1], image: &image.c, ..sized() };
        (fetch.x, fetch.y, fetch.whole_width, fetch.whole_height) = (2, 1, 16, 16);
        done(vrtm_asset_fetch(&fetch, 1));
        image.check();
        let image = Image::new(VRTM_PIXEL_F32, 2);
        done(vrtm_tile_fetch_dilation(tiles[0], 0.1, &image.c));
        image.check();
        let mut uvs = [f32::NAN; 2 * CORNERS];
        done(vrtm_asset_fetch_corner_uvs(asset, 0, uvs.as_mut_ptr(), CORNERS));
        assert!(uvs.iter().all(|x| x.is_finite()));
        let mut layers = [7; FACES];
        done(vrtm_asset_fetch_face_layers(asset, 0, layers.as_mut_ptr(), FACES));
        assert_eq!(layers, [0; FACES]);
        let map = vrtm_map_desc { width: 8, height: 8, ..sized() };
        done(vrtm_tile_inspect_map(tiles[0], &map, &mut sized()));
        for tile in tiles {
            done(vrtm_tile_get_info(tile, &mut sized()));
            done(vrtm_tile_get_estimate(tile, &mut sized()));
            done(vrtm_tile_get_report(tile, &mut sized()));
        }
        done(vrtm_asset_get_report(asset, &mut sized()));
        done(vrtm_device_get_info(device, &mut sized()));
    }
    end(device, asset);
}

#[test]
fn tiles_saved_repainted_and_solved_warm() {
    let device = device(1);
    let (asset, [tile, _]) = asset(device);
    let (mut bent, mut more) = (pose(0.25), pose(0.5));
    let options = vrtm_solve_options { tiles: &tile, tile_count: 1, ..least() };
    // SAFETY: all pointers point to memory of the size that the structs tell.
    unsafe {
        done(vrtm_asset_solve(asset, &bent.c(), &options));
        let (mut size, mut texels) = (0, Bytes::new(64, 1));
        done(vrtm_tile_save(tile, ptr::null_mut(), 0, &mut size));
        let mut saved = Bytes::new(size, 1);
        done(vrtm_tile_save(tile, saved.pointer(), size, &mut size));
        let image =
            vrtm_image { format: VRTM_PIXEL_U8, data: texels.pointer(), width: 8, height: 8, ..sized() };
        done(vrtm_tile_update_rigidity(tile, &image, 3, 3, 2, 2));
        done(vrtm_tile_set_mask(tile, &image));
        done(vrtm_asset_solve(
            asset,
            &more.c(),
            &vrtm_solve_options { warm: 1, temporal_weight: 0.1, ..options },
        ));
        done(vrtm_tile_set_mask(tile, ptr::null()));
        paint(tile);
        done(vrtm_tile_load(tile, saved.pointer(), size));
        let dirty = [5];
        let options = vrtm_solve_options { dirty_vertices: dirty.as_ptr(), dirty_vertex_count: 1, ..options };
        done(vrtm_asset_solve(asset, &bent.c(), &options));
    }
    end(device, asset);
}

#[test]
fn the_paper_s_solver_with_memory_and_threads_of_a_host() {
    let blocks = AtomicIsize::new(0);
    let allocator = vrtm_allocator {
        alloc: Some(alloc),
        free: Some(free),
        user: (&raw const blocks).cast_mut().cast(),
        ..sized()
    };
    let executor = vrtm_executor { parallel_for: Some(parallel_for), ..sized() };
    let desc = vrtm_device_desc {
        backend: VRTM_BACKEND_CPU,
        threads: 2,
        executor: &executor,
        allocator: &allocator,
        ..vrtm_device_desc::default()
    };
    let mut device = vrtm_device { id: 0 };
    // SAFETY: all pointers point to memory of the size that the structs tell.
    unsafe {
        done(vrtm_device_create(&desc, &mut device));
        let (asset, [tile, _]) = asset(device);
        let options = vrtm_solve_options { solver: VRTM_SOLVER_PBD, tiles: &tile, tile_count: 1, ..least() };
        let image = Image::new(VRTM_PIXEL_F32, 2);
        let fetch = vrtm_fetch { tile, image: &image.c, ..sized() };
        done(vrtm_asset_redirect(asset, &pose(0.5).c(), &options, &fetch, 1));
        image.check();
        end(device, asset);
    }
    assert_eq!(blocks.into_inner(), 0);
}

#[test]
fn a_refinement_and_its_pattern() {
    let device = device(1);
    let (asset, _) = asset(device);
    let mut refinement = vrtm_refinement { id: 0 };
    let mut info = sized::<vrtm_refinement_info>();
    // SAFETY: all pointers point to memory of the size that the structs tell.
    unsafe {
        done(vrtm_asset_solve(asset, &pose(0.5).c(), &least()));
        let desc =
            vrtm_refinement_desc { tolerance: 0.01, max_triangles: 60, ..vrtm_refinement_desc::default() };
        done(vrtm_refinement_create(asset, &desc, &mut refinement));
        done(vrtm_refinement_extend(refinement));
        done(vrtm_refinement_get_info(refinement, &mut info));
        let [vertices, faces, corners] =
            [info.vertices, info.faces, info.corners].map(|count| count as usize);
        let mut numbers = [3 * vertices, faces, faces, corners, 3 * corners].map(|count| vec![7u32; count]);
        let [vertex_sources, face_sources, face_corners, corner_vertices, corner_sources] =
            numbers.each_mut().map(|numbers| numbers.as_mut_ptr());
        let mut weights = [3 * vertices, 3 * corners, 2 * corners].map(|count| vec![7f32; count]);
        let [vertex_weights, corner_weights, corner_uvs] =
            weights.each_mut().map(|weights| weights.as_mut_ptr());
        let pattern = vrtm_refinement_pattern {
            vertex_count: vertices,
            face_count: faces,
            corner_count: corners,
            vertex_sources,
            vertex_weights,
            face_sources,
            face_corners,
            corner_vertices,
            corner_sources,
            corner_weights,
            corner_uvs,
            ..sized()
        };
        done(vrtm_refinement_fetch_pattern(refinement, &pattern));
        done(vrtm_refinement_fetch_corner_uvs(refinement, corner_uvs, corners));
        done(vrtm_refinement_destroy(refinement));
    }
    end(device, asset);
}

#[test]
fn points_are_carried() {
    let device = device(1);
    let (asset, _) = asset(device);
    let (mut carrier, mut info) = (vrtm_carrier { id: 0 }, sized::<vrtm_carrier_info>());
    // Two points on the sheet, one beside it; at odd addresses, between bytes of something else.
    let mut uvs = Bytes::new(3 * 20, 1);
    for (k, uv) in [[0.25f64, 0.5], [1.5, 0.5], [7.5, 0.5]].iter().enumerate() {
        // SAFETY: within the bytes.
        unsafe { uvs.pointer().cast::<u8>().add(20 * k).cast::<[f64; 2]>().write_unaligned(*uv) };
    }
    let points = vrtm_array { data: uvs.pointer(), count: 3, stride: 20, format: VRTM_SCALAR_F64, ..sized() };
    let desc = vrtm_carrier_desc { uvs: &points, ..sized() };
    let mut bytes = Bytes::new(3 * 30, 3);
    let first = bytes.pointer().cast::<u8>();
    // SAFETY: within the bytes, as below.
    let rows = |at| vrtm_array_out { data: unsafe { first.add(at) }.cast(), count: 3, stride: 30, ..sized() };
    let (positions, rotations) = (rows(0), rows(12));
    let carried = vrtm_carried { positions: &positions, rotations: &rotations, ..sized() };
    let mut states = [7; 3];
    // SAFETY: all pointers point to memory of the size that the structs tell.
    unsafe {
        done(vrtm_carrier_create(asset, &desc, &mut carrier));
        done(vrtm_asset_solve(asset, &pose(0.5).c(), &least()));
        done(vrtm_carrier_fetch(carrier, &carried));
        done(vrtm_carrier_fetch_states(carrier, states.as_mut_ptr(), 3));
        done(vrtm_carrier_get_info(carrier, &mut info));
        done(vrtm_carrier_destroy(carrier));
    }
    assert_eq!((states, info.outside), ([VRTM_POINT_BOUND, VRTM_POINT_BOUND, VRTM_POINT_OUTSIDE], 1));
    // The bytes between the rows are as they were.
    assert!(bytes.get().chunks_exact(30).all(|row| row[28..] == [0x5A; 2]));
    end(device, asset);
}

#[test]
fn a_job_on_two_threads() {
    let device = device(2);
    let (asset, [tile, _]) = asset(device);
    let mut job = vrtm_job { id: 0 };
    let options = vrtm_solve_options { tiles: &tile, tile_count: 1, ..least() };
    // SAFETY: all pointers point to memory of the size that the structs tell.
    unsafe {
        done(vrtm_asset_submit(asset, &pose(0.5).c(), &options, &mut job));
        done(vrtm_job_get_progress(job, &mut sized()));
        done(vrtm_job_wait(job, VRTM_FOREVER));
        done(vrtm_job_destroy(job));
        done(vrtm_asset_submit(asset, &pose(0.25).c(), &options, &mut job));
        done(vrtm_job_cancel(job));
        done(vrtm_job_destroy(job));
    }
    end(device, asset);
}
