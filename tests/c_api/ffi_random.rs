//! Thousands of calls in random order, with valid, stale and made-up handles and with good, odd and bad arguments: each
//! returns a known status, none returns VRTM_ERROR_INTERNAL, and failures write nothing.

#![allow(clippy::field_reassign_with_default, reason = "as C programs fill in what an init function wrote")]

use std::ffi::{CStr, c_void};
use std::mem::{size_of, zeroed};
use std::ptr;

use vrtm::TileSettings;
use vrtm_testkit::{gpu, long};

use vrtm_capi::{
    asset::*, device::*, fetch::*, handle::*, mesh::*, report::*, solve::*, status::*, tile::*, types::*,
};

/// A random number generator with the same numbers on every platform (Steele, Lea and Flood's SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }
}

/// Quads per side; two UDIM tiles, so that half of the quads are in each.
const SIDE: usize = 4;
const VERTICES: usize = (SIDE + 1) * (SIDE + 1);
const CORNERS: usize = 4 * SIDE * SIDE;
const MAP: u32 = 16;
const UNTOUCHED: u8 = 0x5A;

/// The memory that the calls point to: every array is as long as the longest that a call may claim.
struct Host {
    random: Random,
    /// The backend that good calls ask a device for.
    backend: vrtm_backend,
    positions: Vec<[f64; 4]>,
    uvs: Vec<[f32; 2]>,
    counts: Vec<u32>,
    indices: Vec<u32>,
    texels: Vec<f32>,
    output: Vec<u8>,
    devices: Vec<u64>,
    assets: Vec<u64>,
    tiles: Vec<u64>,
    statuses: [usize; 10],
}

/// A struct of the C API with its size field set and all else zero.
fn sized<T: Copy>() -> T {
    // SAFETY: plain data, for which all zeros are a valid value; each of these structs starts with its size.
    unsafe {
        let mut value: T = zeroed();
        ptr::from_mut(&mut value).cast::<u32>().write(size_of::<T>() as u32);
        value
    }
}

impl Host {
    fn new(seed: u64) -> Host {
        let mut host = Host {
            random: Random(seed),
            backend: VRTM_BACKEND_AUTO,
            positions: vec![[0.0; 4]; VERTICES],
            uvs: vec![[0.0; 2]; CORNERS],
            counts: vec![4; SIDE * SIDE],
            indices: Vec::new(),
            texels: vec![0.0; 64 * 64],
            output: vec![UNTOUCHED; 64 * 64 * 16],
            devices: vec![0, 1, u64::MAX],
            assets: vec![0, 2, u64::MAX],
            tiles: vec![0, 3, u64::MAX],
            statuses: [0; 10],
        };
        for (k, point) in host.positions.iter_mut().enumerate() {
            *point = [(k % (SIDE + 1)) as f64, (k / (SIDE + 1)) as f64, 0.0, 1.0];
            // u runs from 0 to 2: tiles 1001 and 1002.
            host.uvs[k] = [point[0] as f32 * 0.5, point[1] as f32 * 0.25];
        }
        for j in 0..SIDE {
            for i in 0..SIDE {
                let a = (j * (SIDE + 1) + i) as u32;
                host.indices.extend([a, a + 1, a + SIDE as u32 + 2, a + SIDE as u32 + 1]);
            }
        }
        host
    }

    /// Mostly `good`, sometimes one of `others`.
    fn odd<T: Copy>(&mut self, good: T, others: &[T]) -> T {
        if self.random.one_in(25) { self.random.pick(others) } else { good }
    }

    fn array(&mut self, data: *const c_void, count: usize, format: vrtm_scalar, stride: usize) -> vrtm_array {
        let mut array = sized::<vrtm_array>();
        array.struct_size = self.odd(array.struct_size, &[0, 3, 8, u32::MAX]);
        array.format = self.odd(format, &[-1, 0, 2]);
        array.data = self.odd(data, &[ptr::null()]);
        array.count = self.odd(count, &[0, 1, count - 1, usize::MAX, usize::MAX / 2]);
        array.stride = self.odd(stride, &[0, 1, usize::MAX]);
        array
    }

    fn positions(&mut self) -> vrtm_array {
        for point in &mut self.positions {
            point[2] = 0.01 * (self.random.below(100) as f64);
        }
        if self.random.one_in(20) {
            let bad = self.random.below(VERTICES);
            self.positions[bad][1] = self.random.pick(&[f64::NAN, f64::INFINITY, 1e300, 1e-300]);
        }
        let data = self.positions.as_ptr().cast();
        self.array(data, VERTICES, VRTM_SCALAR_F64, 32)
    }

    fn mend(&mut self) {
        for (k, point) in self.positions.iter_mut().enumerate() {
            *point = [(k % (SIDE + 1)) as f64, (k / (SIDE + 1)) as f64, 0.0, 1.0];
        }
    }

    fn image(&mut self) -> vrtm_image {
        for texel in &mut self.texels {
            *texel = if self.random.0.count_ones().is_multiple_of(2) { 1.0 } else { 0.0 };
            self.random.0 = self.random.0.rotate_left(7).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        }
        if self.random.one_in(20) {
            self.texels[3] = f32::NAN;
        }
        let mut image = sized::<vrtm_image>();
        image.struct_size = self.odd(image.struct_size, &[0, 9, u32::MAX]);
        image.format = self.odd(VRTM_PIXEL_F32, &[-1, 1, 2, 3, 4]);
        image.data = self.odd(self.texels.as_ptr().cast(), &[ptr::null()]);
        image.width = self.odd(MAP, &[0, 1, 3, 17]);
        image.height = self.odd(MAP, &[0, 1, 5, 17]);
        image.row_stride = self.odd(0, &[1, 68, 71, usize::MAX]);
        image.pixel_stride = self.odd(0, &[1, 4, 5]);
        image.origin = self.odd(VRTM_ORIGIN_TOP, &[-1, 1, 2]);
        image
    }

    fn target(&mut self, part: usize) -> vrtm_image_out {
        let half = self.output.len() / 2;
        let mut image = sized::<vrtm_image_out>();
        image.struct_size = self.odd(image.struct_size, &[0, 9, u32::MAX]);
        image.format = self.odd(VRTM_PIXEL_F32, &[-1, 1, 2, 3, 4]);
        // SAFETY: inside the output's memory.
        let data = unsafe { self.output.as_mut_ptr().add(part * half) };
        image.data = self.odd(data.cast(), &[ptr::null_mut()]);
        image.width = self.odd(MAP, &[0, 1, 17]);
        image.height = self.odd(MAP, &[0, 1, 17]);
        image.row_stride = self.odd(0, &[1, 160, 301, usize::MAX]);
        image.pixel_stride = self.odd(0, &[1, 4, 9]);
        image.origin = self.odd(VRTM_ORIGIN_TOP, &[-1, 1, 2]);
        image
    }

    /// A handle of any kind, valid or stale, mostly of the right kind.
    fn handle(&mut self, of: fn(&Host) -> &Vec<u64>) -> u64 {
        if self.random.one_in(20) {
            let wrong = [&self.devices, &self.assets, &self.tiles].map(|ids| ids[ids.len() - 1]);
            return self.random.pick(&wrong) ^ if self.random.one_in(3) { 1 } else { 0 };
        }
        // Mostly one of the newest, because they are likely to be valid.
        let ids = of(self).clone();
        let newest = ids.len().min(3);
        if self.random.one_in(10) {
            self.random.pick(&ids)
        } else {
            ids[ids.len() - 1 - self.random.below(newest)]
        }
    }

    fn device(&mut self) -> vrtm_device {
        vrtm_device { id: self.handle(|host| &host.devices) }
    }

    fn asset(&mut self) -> vrtm_asset {
        vrtm_asset { id: self.handle(|host| &host.assets) }
    }

    fn tile(&mut self) -> vrtm_tile {
        vrtm_tile { id: self.handle(|host| &host.tiles) }
    }

    fn create_asset(&mut self) -> vrtm_status {
        let positions = self.positions();
        let uvs = self.uvs.as_ptr().cast();
        let uvs = self.array(uvs, VERTICES, VRTM_SCALAR_F32, 8);
        let mut mesh = vrtm_mesh_desc::default();
        mesh.positions = self.odd(&raw const positions, &[ptr::null()]);
        mesh.face_counts = self.odd(self.counts.as_ptr(), &[ptr::null()]);
        mesh.face_count = self.odd(SIDE * SIDE, &[0, 1]);
        mesh.indices = self.odd(self.indices.as_ptr(), &[ptr::null()]);
        mesh.index_count = self.odd(CORNERS, &[0, 1, CORNERS - 1]);
        mesh.uvs = self.odd(&raw const uvs, &[ptr::null()]);
        mesh.v = self.odd(ptr::null(), &[&raw const uvs]);
        mesh.uv_indices = self.odd(self.indices.as_ptr(), &[ptr::null()]);
        mesh.uv_index_count = self.odd(CORNERS, &[0, 5]);
        let set = vrtm_uv_set {
            uvs: self.odd(&raw const uvs, &[ptr::null()]),
            u: ptr::null(),
            v: ptr::null(),
            uv_indices: self.odd(self.indices.as_ptr(), &[ptr::null()]),
            uv_index_count: self.odd(CORNERS, &[0, 5]),
        };
        mesh.uv_sets = self.odd(ptr::null(), &[&raw const set]);
        mesh.uv_set_count = 1;
        mesh.face_offsets = self.odd(ptr::null(), &[self.indices.as_ptr()]);
        mesh.face_offset_count = self.odd(5, &[0, 1]);
        mesh.seams = self.odd(ptr::null(), &[self.indices.as_ptr()]);
        mesh.seam_count = self.odd(7, &[0, CORNERS / 2]);
        mesh.textured_faces = self.odd(ptr::null(), &[self.indices.as_ptr()]);
        mesh.textured_face_count = self.odd(3, &[0, CORNERS]);
        mesh.weld = self.odd(VRTM_WELD_INDEX, &[VRTM_WELD_POSITION, VRTM_WELD_OFF, -1, 3]);
        mesh.weld_uv_tolerance = self.odd(mesh.weld_uv_tolerance, &[-1.0, f64::NAN, 1e-30, 0.0, 1.0]);
        mesh.weld_position_tolerance =
            self.odd(mesh.weld_position_tolerance, &[-1.0, f64::INFINITY, 1e-30, 0.0, 1.0]);
        let device = self.device();
        let mut asset = vrtm_asset { id: 77 };
        // SAFETY: all pointers are null or point to valid memory of at least the claimed size.
        let status = unsafe { vrtm_asset_create(device, &mesh, &mut asset) };
        assert_eq!(status == VRTM_OK, asset.id != 77);
        if status == VRTM_OK {
            self.assets.push(asset.id);
            for index in 0..2 {
                let mut tile = vrtm_tile { id: 77 };
                // SAFETY: as above.
                if unsafe { vrtm_asset_get_tile(asset, index, &mut tile) } == VRTM_OK {
                    self.tiles.push(tile.id);
                    // The default grid is 1024 x 1024 where there is no map: too slow for thousands of calls.
                    let mut settings = vrtm_tile_settings::default();
                    settings.grid_width = 16;
                    settings.grid_height = 16;
                    // SAFETY: as above.
                    unsafe { vrtm_tile_set_settings(tile, &settings) };
                }
            }
        }
        status
    }

    fn solve_options(&mut self) -> vrtm_solve_options {
        let mut options = vrtm_solve_options::default();
        options.quality = self.random.below(3) as i32;
        options.warm = self.odd(0, &[1, 1, 2]);
        options.temporal_weight = self.odd(0.0, &[0.1, 1e6, -1.0, f32::NAN]);
        options.measure = self.odd(0, &[1, 9]);
        options.tolerance = self.odd(0.0, &[0.5, 1.0, f32::NAN, -1.0]);
        options.time_budget_ms = self.odd(0.0, &[1e-3, -1.0, f32::INFINITY]);
        options.max_corrections = self.odd(0, &[1, 100]);
        options.solver = self.odd(0, &[1, 1, 2, -1]);
        options.pbd.iterations = self.odd(1, &[0, 3, 5000]);
        options.pbd.smoothing = self.odd(0.8, &[0.5, 0.0, 1.5, f32::NAN]);
        options
    }

    /// Calls one function. The flag is true if the call may have written to `output`.
    fn call(&mut self) -> (vrtm_status, bool) {
        let choice = self.random.below(40);
        // SAFETY: all pointers are null or point to valid memory of at least the claimed size.
        unsafe {
            let status = match choice {
                0 => {
                    let mut desc = sized::<vrtm_device_desc>();
                    desc.backend = self.odd(self.backend, &[1, 2, 3, -1]);
                    desc.threads = self.odd(2, &[0, 1, 5000]);
                    desc.memory_budget = self.odd(0, &[1, 100_000]);
                    let mut device = vrtm_device { id: 77 };
                    let status = vrtm_device_create(&desc, &mut device);
                    assert_eq!(status == VRTM_OK, device.id != 77);
                    if status == VRTM_OK {
                        self.devices.push(device.id);
                    }
                    status
                }
                1 => {
                    let mut info = sized::<vrtm_device_info>();
                    vrtm_device_get_info(self.device(), &mut info)
                }
                2 if self.random.one_in(3) => vrtm_device_destroy(self.device()),
                3 if self.random.one_in(2) => vrtm_asset_destroy(self.asset()),
                2..=4 => self.create_asset(),
                5 => {
                    let mut info = sized::<vrtm_asset_info>();
                    vrtm_asset_get_info(self.asset(), &mut info)
                }
                6 => {
                    let mut tile = vrtm_tile { id: 0 };
                    let udim = self.odd(1002, &[0, 1001, 1003, u32::MAX]);
                    let key =
                        vrtm_tile_key { udim, uv_set: self.odd(0, &[1, 7]), ..vrtm_tile_key::default() };
                    vrtm_asset_find_tile(self.asset(), &key, &mut tile)
                }
                7 | 8 => {
                    let mut info = sized::<vrtm_tile_info>();
                    vrtm_tile_get_info(self.tile(), &mut info)
                }
                9..=13 => {
                    let image = self.image();
                    vrtm_tile_set_rigidity(self.tile(), self.odd(&raw const image, &[ptr::null()]))
                }
                14 | 15 => {
                    let image = self.image();
                    vrtm_tile_set_mask(self.tile(), self.odd(ptr::null(), &[&raw const image]))
                }
                16 => {
                    let data = self.texels.as_ptr().cast();
                    let values = self.array(data, VERTICES, VRTM_SCALAR_F32, 4);
                    let values = self.odd(ptr::null(), &[&raw const values]);
                    if self.random.one_in(2) {
                        vrtm_asset_set_vertex_mask(self.asset(), values)
                    } else {
                        vrtm_asset_set_vertex_rigidity(self.asset(), values)
                    }
                }
                17 | 18 => {
                    let mut numbers = TileSettings::default();
                    for setting in TileSettings::SETTINGS {
                        if let (Some([least, most]), Some(value)) =
                            (setting.limits, numbers.number(setting.name))
                        {
                            *value = self.odd(*value, &[least, most.min(0.1), 2.0 * most, f32::NAN]);
                        }
                    }
                    let mut settings = vrtm_tile_settings::from(&numbers);
                    settings.overlap = self.odd(0, &[1, 2, -1]);
                    settings.grid_width = self.odd(16, &[1, 16, 33, 20000]);
                    settings.grid_height = self.odd(16, &[1, 16, 33, 20000]);
                    settings.seams = self.odd(0, &[1, 1, 2]);
                    settings.seam_reach = self.odd(0.03125, &[0.3, 0.0, f32::NAN]);
                    settings.open_borders = self.odd(0, &[1, 1, 2]);
                    vrtm_tile_set_settings(self.tile(), &settings)
                }
                19 => {
                    let mut settings = sized::<vrtm_tile_settings>();
                    vrtm_tile_get_settings(self.tile(), &mut settings)
                }
                20..=25 => {
                    let (positions, options) = (self.positions(), self.solve_options());
                    vrtm_asset_solve(self.asset(), &positions, &options)
                }
                26..=29 => {
                    let image = self.target(0);
                    let mut fetch = sized::<vrtm_fetch>();
                    fetch.kind = self.odd(0, &[1, 2, 3, -1]);
                    (fetch.tile, fetch.image) = (self.tile(), &image);
                    fetch.whole_width = self.odd(0, &[1, 64, u32::MAX]);
                    fetch.whole_height = self.odd(0, &[1, 64, u32::MAX]);
                    fetch.x = self.odd(0, &[1, u32::MAX]);
                    return (vrtm_asset_fetch(&fetch, 1), true);
                }
                30..=34 => {
                    let (positions, options) = (self.positions(), self.solve_options());
                    let images = [self.target(0), self.target(1)];
                    let mut fetches = [sized::<vrtm_fetch>(), sized::<vrtm_fetch>()];
                    for (fetch, image) in fetches.iter_mut().zip(&images) {
                        fetch.kind = self.odd(0, &[1, 2, 3]);
                        fetch.tile = self.tile();
                        fetch.image = image;
                    }
                    let asset = self.asset();
                    let count = self.random.below(3);
                    return (vrtm_asset_redirect(asset, &positions, &options, fetches.as_ptr(), count), true);
                }
                35 => {
                    let count = self.odd(CORNERS, &[0, 1, CORNERS - 1, usize::MAX]);
                    let uvs = self.output.as_mut_ptr().cast();
                    return (vrtm_asset_fetch_corner_uvs(self.asset(), self.odd(0, &[1]), uvs, count), true);
                }
                36 | 37 => {
                    let mut report = sized::<vrtm_tile_report>();
                    let status = vrtm_tile_get_report(self.tile(), &mut report);
                    assert!(status != VRTM_OK || report.folds == 0 && report.min_jacobian > 0.0);
                    status
                }
                38 => {
                    let mut report = sized::<vrtm_asset_report>();
                    vrtm_asset_get_report(self.asset(), &mut report)
                }
                _ => {
                    let mut key = vrtm_tile_key::default();
                    vrtm_tile_get_key(self.tile(), &mut key)
                }
            };
            (status, false)
        }
    }

    fn last_error() -> String {
        // SAFETY: a zero-terminated line of this thread.
        unsafe { CStr::from_ptr(vrtm_last_error()) }.to_string_lossy().into_owned()
    }

    fn run(&mut self, calls: usize) {
        for number in 0..calls {
            let (status, writes) = self.call();
            // Another thread may have destroyed the asset, whose solve is then cancelled.
            let known = (VRTM_OK..=VRTM_ERROR_CANCELLED).contains(&status);
            assert!(known, "call {number}: status {status}");
            assert_ne!(status, VRTM_ERROR_INTERNAL, "call {number}: {}", Host::last_error());
            if status != VRTM_OK {
                assert!(Host::last_error().starts_with("vrtm_"), "call {number}: {}", Host::last_error());
            }
            let untouched = self.output.iter().all(|&byte| byte == UNTOUCHED);
            assert!(untouched || status == VRTM_OK && writes, "call {number} wrote ({})", Host::last_error());
            self.output.fill(UNTOUCHED);
            self.mend();
            self.statuses[status as usize] += 1;
        }
        for &id in &self.assets {
            // SAFETY: any number may be given.
            unsafe { vrtm_asset_destroy(vrtm_asset { id }) };
        }
        for &id in &self.devices {
            // SAFETY: any number may be given.
            unsafe { vrtm_device_destroy(vrtm_device { id }) };
        }
    }
}

#[test]
fn random_calls_never_do_harm() {
    let mut host = Host::new(1);
    let calls = long::cases(6000, 2000, "calls") as usize;
    host.run(calls);
    println!("calls by status: {:?}", host.statuses);
    // If nearly all calls failed, or none did, the test would check little.
    assert!(host.statuses[VRTM_OK as usize] > calls / 4, "{:?}", host.statuses);
    for status in [VRTM_ERROR_INVALID_ARGUMENT, VRTM_ERROR_INVALID_HANDLE, VRTM_ERROR_NOT_SOLVED] {
        assert!(host.statuses[status as usize] > calls / 300, "{:?}", host.statuses);
    }
}

#[test]
fn random_calls_on_many_threads_never_do_harm() {
    std::thread::scope(|scope| {
        for seed in 2..5 {
            // The library takes a thread without a name for one of its own, and keeps its panics to itself.
            let thread = std::thread::Builder::new().name(format!("seed {seed}"));
            thread.spawn_scoped(scope, move || Host::new(seed).run(1500)).unwrap();
        }
    });
}

#[test]
fn random_calls_to_a_gpu_never_do_harm() {
    if !gpu::has_gpu() {
        return;
    }
    let mut host = Host { backend: VRTM_BACKEND_GPU, ..Host::new(9) };
    let calls = long::cases(500, 200, "calls") as usize;
    host.run(calls);
    println!("calls by status: {:?}", host.statuses);
    assert!(host.statuses[VRTM_OK as usize] > calls * 6 / 25, "{:?}", host.statuses);
}
