//! Calls in any order, from up to three threads at once, with handles that are valid, destroyed, of another kind or made up:
//! each gives a known status, a failing one leaves its outputs alone, and none touches memory that is gone.

use std::ptr;
use std::sync::Mutex;

use super::{CORNERS, Input, Sheet, check, options, sized};
use vrtm_capi::{
    asset::*, carrier::*, device::*, fetch::*, handle::*, job::*, prepare::*, report::*, solve::*, status::*,
    tile::*, types::*,
};

const KINDS: usize = 5;
const DEVICES: usize = 0;
const ASSETS: usize = 1;
const TILES: usize = 2;
const JOBS: usize = 3;
const CARRIERS: usize = 4;

/// Handles that were given out, also those that are gone.
struct Handles {
    ids: [Mutex<Vec<u64>>; KINDS],
    /// The backend of devices.
    backend: vrtm_backend,
}

impl Handles {
    fn add(&self, kind: usize, id: u64) {
        self.ids[kind].lock().unwrap().push(id);
    }

    /// Mostly one of the newest of its kind, which are likely to be valid.
    fn pick(&self, input: &mut Input, kind: usize) -> u64 {
        let kind = input.odd(kind, &[DEVICES, ASSETS, TILES, JOBS, CARRIERS]);
        let ids = self.ids[kind].lock().unwrap().clone();
        match input.below(20) {
            18 => input.pick(&[0, 1, u64::MAX, 1 << 63]),
            19 => input.any().unwrap_or(0),
            17 if !ids.is_empty() => ids[input.below(ids.len())] ^ (1 << input.below(64)),
            14..=16 if !ids.is_empty() => ids[input.below(ids.len())],
            _ if ids.is_empty() => 0,
            _ => ids[ids.len() - 1 - input.below(ids.len().min(3))],
        }
    }
}

/// One input, on the CPU.
pub fn run(bytes: &[u8]) {
    run_on(VRTM_BACKEND_CPU, bytes);
}

pub fn run_on(backend: vrtm_backend, bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let handles = Handles { ids: Default::default(), backend };
    let threads = 1 + input.below(3);
    for _ in 0..2 {
        call(&mut input, &handles, 0);
        call(&mut input, &handles, 1);
    }
    let rest = input.rest();
    std::thread::scope(|scope| {
        let mut running = Vec::new();
        for part in rest.chunks(rest.len().div_ceil(threads).max(1)) {
            let handles = &handles;
            // The library takes a thread without a name for one of its own, and keeps its panics to itself.
            let thread = std::thread::Builder::new().name("a host's".into());
            let calls = move || {
                let mut input = Input::new(part);
                for _ in 0..40 {
                    if input.ended() {
                        break;
                    }
                    let number = input.below(36);
                    call(&mut input, handles, number);
                }
            };
            running.push(thread.spawn_scoped(scope, calls).unwrap());
        }
        // The scope's own end does not wait until the threads' memory is freed, and that would count as a leak.
        running.into_iter().for_each(|thread| thread.join().unwrap());
    });
    for &id in handles.ids[CARRIERS].lock().unwrap().iter() {
        // SAFETY: any number may be given.
        check(unsafe { vrtm_carrier_destroy(vrtm_carrier { id }) });
    }
    for &id in handles.ids[JOBS].lock().unwrap().iter() {
        // SAFETY: any number may be given.
        check(unsafe { vrtm_job_destroy(vrtm_job { id }) });
    }
    for &id in handles.ids[ASSETS].lock().unwrap().iter() {
        // SAFETY: any number may be given.
        check(unsafe { vrtm_asset_destroy(vrtm_asset { id }) });
    }
    for &id in handles.ids[DEVICES].lock().unwrap().iter() {
        // SAFETY: any number may be given.
        check(unsafe { vrtm_device_destroy(vrtm_device { id }) });
    }
}

/// A call for carriers.
///
/// # Safety
/// Any handle may be given.
unsafe fn carry(input: &mut Input, handles: &Handles, number: usize, asset: vrtm_asset) {
    const COUNT: usize = 5;
    let carrier = vrtm_carrier { id: handles.pick(input, CARRIERS) };
    let numbers: [f64; 3 * COUNT] = std::array::from_fn(|_| input.number());
    let mut given = sized::<vrtm_array>();
    (given.data, given.count, given.format) = (numbers.as_ptr().cast(), COUNT, VRTM_SCALAR_F64);
    // SAFETY: all pointers point to memory of the claimed size.
    unsafe {
        match number {
            32 => {
                let corners: [u32; 3 * COUNT] =
                    std::array::from_fn(|k| input.odd(k as u32 % 3, &[9, 1 << 30]));
                let pieces: [u32; COUNT] = std::array::from_fn(|_| input.pick(&[0, 1, u32::MAX]));
                let mut desc = sized::<vrtm_carrier_desc>();
                (desc.bind, desc.fit) = (input.below(4) as i32, input.below(4) as i32);
                (desc.uvs, desc.weights, desc.positions) = (&given, &given, &given);
                desc.corners = corners.as_ptr();
                desc.pieces = input.pick(&[ptr::null(), pieces.as_ptr()]);
                desc.heights = input.pick(&[ptr::null(), &raw const given]);
                (desc.skirt, desc.farthest) = (input.number(), input.number());
                let mut made = vrtm_carrier { id: 77 };
                if check(vrtm_carrier_create(asset, &desc, &mut made)) {
                    handles.add(CARRIERS, made.id);
                }
            }
            33 | 34 => {
                let mut out = [f64::NAN; 4 * COUNT];
                let mut array = sized::<vrtm_array_out>();
                (array.data, array.count, array.format) = (out.as_mut_ptr().cast(), COUNT, VRTM_SCALAR_F64);
                let mut carried = sized::<vrtm_carried>();
                match input.below(4) {
                    0 => carried.positions = &array,
                    1 => carried.rotations = &array,
                    2 => carried.stretch = &array,
                    _ => carried.uvs = &array,
                }
                let done = check(vrtm_carrier_fetch(carrier, &carried));
                assert!(done || out.iter().all(|x| x.is_nan()));
                check(vrtm_carrier_get_info(carrier, &mut sized()));
            }
            _ => _ = check(vrtm_carrier_destroy(carrier)),
        }
    }
}

/// One call, chosen by `number`.
fn call(input: &mut Input, handles: &Handles, number: usize) {
    let device = vrtm_device { id: handles.pick(input, DEVICES) };
    let asset = vrtm_asset { id: handles.pick(input, ASSETS) };
    let tile = vrtm_tile { id: handles.pick(input, TILES) };
    let mut sheet = Sheet::default();
    let texels: [u8; 64] = std::array::from_fn(|k| if k % 8 / 2 % 2 == 1 { 255 } else { 0 });
    let mut image = sized::<vrtm_image>();
    (image.width, image.height, image.format) = (8, 8, VRTM_PIXEL_U8);
    image.data = texels.as_ptr().cast();
    // Room for as many channels as any kind has.
    let mut map = [f32::NAN; 4 * 8 * 8];
    let mut target = sized::<vrtm_image_out>();
    (target.width, target.height) = (8, 8);
    target.data = map.as_mut_ptr().cast();
    let untouched = |map: &[f32]| map.iter().all(|x| x.is_nan());
    // SAFETY: all pointers are null or point to memory of the claimed size; any handle may be given.
    unsafe {
        match number {
            0 => {
                let mut desc = sized::<vrtm_device_desc>();
                desc.backend = handles.backend;
                desc.threads = input.odd(1, &[2, 3, 5000]);
                desc.memory_budget = input.odd(0, &[1, 20_000, 1 << 20]);
                let mut made = vrtm_device { id: 77 };
                let done = check(vrtm_device_create(&desc, &mut made));
                assert_eq!(done, made.id != 77);
                if done {
                    handles.add(DEVICES, made.id);
                }
            }
            1 | 2 => {
                let mut made = vrtm_asset { id: 77 };
                if sheet.create(device, &mut made) == VRTM_OK {
                    handles.add(ASSETS, made.id);
                    for index in 0..2 {
                        let mut tile = vrtm_tile { id: 77 };
                        if check(vrtm_asset_get_tile(made, index, &mut tile)) {
                            handles.add(TILES, tile.id);
                        }
                    }
                } else {
                    assert_eq!(made.id, 77);
                }
            }
            3 => _ = check(vrtm_device_get_info(device, &mut sized())),
            4 if input.below(3) == 2 => _ = check(vrtm_device_destroy(device)),
            5 if input.below(2) == 1 => _ = check(vrtm_asset_destroy(asset)),
            4 | 5 => _ = check(vrtm_asset_get_info(asset, &mut sized())),
            6 => _ = check(vrtm_tile_get_key(tile, &mut vrtm_tile_key::default())),
            7 => {
                let mut found = vrtm_tile { id: 0 };
                let udim = input.odd(1002, &[0, 1001, 1003, u32::MAX]);
                let key =
                    vrtm_tile_key { udim, uv_set: input.odd(0, &[1]), layer: input.odd(0, &[1]), layers: 0 };
                check(vrtm_asset_find_tile(asset, &key, &mut found));
            }
            8 => _ = check(vrtm_tile_get_info(tile, &mut sized())),
            9 | 10 => _ = check(vrtm_tile_set_rigidity(tile, input.odd(&raw const image, &[ptr::null()]))),
            11 => _ = check(vrtm_tile_set_mask(tile, input.odd(ptr::null(), &[&raw const image]))),
            12 => {
                let [x, y] = [(); 2].map(|()| input.below(9) as u32);
                check(vrtm_tile_update_rigidity(tile, &image, x, y, 3, 2));
            }
            13 => {
                let mut settings = sized::<vrtm_tile_settings>();
                if check(vrtm_tile_get_settings(tile, &mut settings)) {
                    settings.grid_width = input.odd(16, &[17, 33, 48]);
                    settings.overlap = input.odd(0, &[1, 2]);
                    settings.orientation_density = input.odd(0.0, &[0.5, -1.0]);
                    settings.harm = input.odd(10.0, &[0.0, 16.0, -1.0]);
                    settings.seams = input.odd(VRTM_SEAMS_SHUT, &[VRTM_SEAMS_CONTINUE, VRTM_SEAMS_KEEP, 3]);
                    settings.open_borders = input.odd(VRTM_OPEN_BORDERS_FIXED, &[VRTM_OPEN_BORDERS_SLIDE, 2]);
                    for number in [
                        &mut settings.smoothness,
                        &mut settings.smoothness_floor,
                        &mut settings.orientation,
                        &mut settings.room,
                        &mut settings.room_threshold,
                        &mut settings.seam_reach,
                    ] {
                        *number = input.odd(*number, &[0.0, 0.1, 1e4, -1.0, f32::NAN]);
                    }
                    check(vrtm_tile_set_settings(tile, &settings));
                }
            }
            14 => {
                let mut size = 77;
                let mut data = vec![0_u8; 1 << 16];
                let capacity = input.odd(data.len(), &[0, 100]);
                let done = check(vrtm_tile_save(tile, data.as_mut_ptr().cast(), capacity, &mut size));
                assert_eq!(done, size != 77);
                if done {
                    let other = vrtm_tile { id: handles.pick(input, TILES) };
                    check(vrtm_tile_load(other, data.as_ptr().cast(), size));
                }
            }
            15 => _ = check(vrtm_tile_get_estimate(tile, &mut sized())),
            16..=18 => {
                sheet.bend(input);
                check(vrtm_asset_solve(asset, &sheet.positions(), &options(input)));
            }
            19 => {
                let kind = input.pick(&[
                    VRTM_FETCH_REDIRECTION,
                    VRTM_FETCH_REDIRECTION_DELTA,
                    VRTM_FETCH_WARP,
                    VRTM_FETCH_REDIRECTION_UDIM,
                    VRTM_FETCH_JACOBIAN,
                    VRTM_FETCH_FILTER_SCALE,
                    9,
                ]);
                let mut fetch = sized::<vrtm_fetch>();
                (fetch.kind, fetch.tile, fetch.image) = (kind, tile, &raw const target);
                let done = check(vrtm_asset_fetch(&fetch, 1));
                // Whole channels, as many as the kind has.
                let written = map.iter().take_while(|x| x.is_finite()).count();
                assert_eq!((written > 0, written % 64), (done, 0));
                assert!(untouched(&map[written..]));
            }
            20 => {
                sheet.bend(input);
                let mut fetch = sized::<vrtm_fetch>();
                (fetch.tile, fetch.image) = (tile, &raw const target);
                let count = input.odd(1, &[0]);
                let done =
                    check(vrtm_asset_redirect(asset, &sheet.positions(), &options(input), &fetch, count));
                assert!(done || untouched(&map));
            }
            21 => {
                let mut uvs = [f32::NAN; 2 * CORNERS];
                let done =
                    check(vrtm_asset_fetch_corner_uvs(asset, input.odd(0, &[1]), uvs.as_mut_ptr(), CORNERS));
                assert!(if done { uvs.iter().all(|x| x.is_finite()) } else { untouched(&uvs) });
            }
            22 => _ = check(vrtm_tile_get_report(tile, &mut sized())),
            23 => _ = check(vrtm_asset_get_report(asset, &mut sized())),
            24 | 25 => {
                sheet.bend(input);
                let mut options = options(input);
                let (tiles, vertices) =
                    ([tile, vrtm_tile { id: handles.pick(input, TILES) }], [0, 5, 5, 15, 16]);
                (options.tiles, options.tile_count) =
                    input.odd((ptr::null(), 0), &[(tiles.as_ptr(), 1), (tiles.as_ptr(), 2)]);
                options.dirty_vertices = input.odd(ptr::null(), &[vertices.as_ptr()]);
                options.dirty_vertex_count = input.odd(4, &[0, 5]);
                let mut job = vrtm_job { id: 77 };
                let done = check(vrtm_asset_submit(asset, &sheet.positions(), &options, &mut job));
                assert_eq!(done, job.id != 77);
                if done {
                    handles.add(JOBS, job.id);
                }
            }
            26 => _ = check(vrtm_asset_cancel(asset)),
            number => {
                let job = vrtm_job { id: handles.pick(input, JOBS) };
                match number {
                    27 => _ = check(vrtm_job_wait(job, input.pick(&[0, 1, 5, VRTM_FOREVER]))),
                    28 => _ = check(vrtm_job_cancel(job)),
                    29 => {
                        let mut data = sized::<vrtm_job_progress>();
                        if check(vrtm_job_get_progress(job, &mut data)) {
                            assert!((0.0..=1.0).contains(&data.progress) && data.ms >= 0.0);
                        }
                    }
                    30 | 31 => _ = check(vrtm_job_destroy(job)),
                    _ => carry(input, handles, number, asset),
                }
            }
        }
    }
}
