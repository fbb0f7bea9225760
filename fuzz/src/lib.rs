//! The targets, and what they share: numbers out of the fuzzer's bytes, memory of exactly the size that a call may read, a
//! small mesh, and what must hold after any call. tests/c_api runs them, too, with random bytes.

#![allow(clippy::field_reassign_with_default, reason = "as C programs fill in what an init function wrote")]

pub mod calls;
pub mod images;
pub mod mesh;
pub mod saved;

use std::ffi::{CStr, c_void};
use std::mem::{size_of, zeroed};
use std::ptr;
use std::sync::atomic::{AtomicUsize, Ordering};

use arbitrary::{Arbitrary, Unstructured};
use vrtm_capi::{asset::*, device::*, handle::*, mesh::*, solve::*, status::*, tile::*, types::*};

/// The fuzzer's bytes as choices; when they end, each choice is the first one.
pub struct Input<'a>(Unstructured<'a>);

impl<'a> Input<'a> {
    pub fn new(bytes: &'a [u8]) -> Input<'a> {
        Input(Unstructured::new(bytes))
    }

    pub fn ended(&self) -> bool {
        self.0.is_empty()
    }

    /// 0..n.
    pub fn below(&mut self, n: usize) -> usize {
        self.0.int_in_range(0..=n - 1).unwrap_or(0)
    }

    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    /// Mostly `good`, sometimes one of `others`.
    pub fn odd<T: Copy>(&mut self, good: T, others: &[T]) -> T {
        if self.below(16) == 15 { self.pick(others) } else { good }
    }

    pub fn any<T: Arbitrary<'a>>(&mut self) -> Option<T> {
        self.0.arbitrary().ok()
    }

    /// All bytes that are left.
    pub fn rest(&mut self) -> &'a [u8] {
        self.0.bytes(self.0.len()).unwrap_or(&[])
    }

    /// Mostly a small multiple of 1/16, sometimes a number of any kind.
    pub fn number(&mut self) -> f64 {
        match self.below(24) {
            0..=20 => f64::from(self.any::<i8>().unwrap_or(0)) / 16.0,
            21 => f64::from_bits(self.any().unwrap_or(0)),
            22 => f64::from(f32::from_bits(self.any().unwrap_or(0))),
            _ => self.pick(&[
                0.0,
                -0.0,
                1e-40,
                1e-300,
                1e30,
                1e300,
                f64::NAN,
                f64::INFINITY,
                f64::NEG_INFINITY,
                1e9,
            ]),
        }
    }
}

/// A struct of the C API with its size field set and all else zero.
pub fn sized<T: Copy>() -> T {
    // SAFETY: plain data, for which all zeros are a valid value; each of these structs starts with its size.
    unsafe {
        let mut value: T = zeroed();
        ptr::from_mut(&mut value).cast::<u32>().write(size_of::<T>() as u32);
        value
    }
}

/// The message of this thread's last failure.
pub fn last_error() -> String {
    // SAFETY: a zero-terminated line of this thread.
    unsafe { CStr::from_ptr(vrtm_last_error()) }.to_str().expect("UTF-8").to_owned()
}

/// Numbers of calls, by their status.
pub static STATUSES: [AtomicUsize; 11] = [const { AtomicUsize::new(0) }; 11];

/// What holds of any call's status. True if the call succeeded.
pub fn check(status: vrtm_status) -> bool {
    // SAFETY: a zero-terminated string of the library.
    let name = unsafe { CStr::from_ptr(vrtm_status_string(status)) }.to_str().expect("UTF-8");
    assert!(name.starts_with("VRTM_"), "status {status}");
    assert_ne!(status, VRTM_ERROR_INTERNAL, "{}", last_error());
    STATUSES[status as usize].fetch_add(1, Ordering::Relaxed);
    if status != VRTM_OK {
        let message = last_error();
        assert!(message.starts_with("vrtm_") && message.len() < 512 && !message.contains('\n'), "{message}");
    }
    status == VRTM_OK
}

/// An address for memory that must not be touched.
pub fn nowhere() -> *mut c_void {
    ptr::without_provenance_mut(16)
}

/// Bytes that begin anywhere in a word, so that the sanitizer sees each access beyond them.
pub struct Memory {
    bytes: Vec<u8>,
    skipped: usize,
}

impl Memory {
    pub fn new(size: usize, skipped: usize) -> Memory {
        Memory { bytes: vec![0x5A; size + skipped], skipped }
    }

    pub fn bytes(&mut self) -> &mut [u8] {
        &mut self.bytes[self.skipped..]
    }

    pub fn pointer(&mut self) -> *mut c_void {
        self.bytes().as_mut_ptr().cast()
    }
}

/// A host's array, with the memory that it describes.
pub struct Array {
    memory: Memory,
    pub c: vrtm_array,
}

impl Array {
    /// Its elements, as they are described and as numbers.
    pub fn values(&self) -> (usize, usize, Vec<f64>) {
        let bytes = &self.memory.bytes[self.memory.skipped..];
        let number = |bytes: &[u8]| match self.c.format {
            VRTM_SCALAR_F64 => bytes.try_into().map_or(f64::NAN, f64::from_ne_bytes),
            _ => bytes.try_into().map_or(f64::NAN, |bytes| f32::from_ne_bytes(bytes).into()),
        };
        let size = if self.c.format == VRTM_SCALAR_F64 { 8 } else { 4 };
        (self.c.count, self.c.stride, bytes.chunks(size).map(number).collect())
    }
}

/// An array of `count` elements, mostly a good one.
pub fn array(input: &mut Input, count: usize, components: usize) -> Array {
    let format = input.odd(VRTM_SCALAR_F32, &[VRTM_SCALAR_F64, VRTM_SCALAR_F64, -1, 2, i32::MAX]);
    let size = if format == VRTM_SCALAR_F64 { 8 } else { 4 };
    let element = components * size;
    let stride = input.odd(0, &[element, element + 1, element + size, 1, element - 1]);
    let step = if stride == 0 { element } else { stride };
    let mut memory =
        Memory::new(count.saturating_sub(1) * step + if count > 0 { element } else { 0 }, input.below(2));
    for number in 0..count {
        for component in 0..components {
            let value = input.number();
            let at = number * step + component * size;
            if size == 8 {
                memory.bytes()[at..at + 8].copy_from_slice(&value.to_ne_bytes());
            } else {
                memory.bytes()[at..at + 4].copy_from_slice(&(value as f32).to_ne_bytes());
            }
        }
    }
    let mut c = sized::<vrtm_array>();
    c.struct_size = input.odd(c.struct_size, &[0, 3, c.struct_size - 1, 5000, u32::MAX]);
    c.format = format;
    c.stride = stride;
    c.count = count;
    c.data = memory.pointer();
    match input.below(64) {
        62 => c.data = ptr::null(),
        // No memory has so many elements: the call must see that before it reads the first.
        63 => (c.data, c.count) = (nowhere(), input.pick(&[usize::MAX, usize::MAX / 2, usize::MAX / 4 + 1])),
        _ => {}
    }
    Array { memory, c }
}

/// A device on the CPU.
pub fn device(threads: u32) -> vrtm_device {
    let mut desc = sized::<vrtm_device_desc>();
    desc.backend = VRTM_BACKEND_CPU;
    desc.threads = threads;
    let mut device = vrtm_device { id: 0 };
    // SAFETY: both point to valid values.
    assert_eq!(unsafe { vrtm_device_create(&desc, &mut device) }, VRTM_OK);
    device
}

/// Quads per side of the sheet.
pub const SIDE: usize = 3;
pub const VERTICES: usize = (SIDE + 1) * (SIDE + 1);
pub const CORNERS: usize = 4 * SIDE * SIDE;

/// A flat sheet; u runs from 0.125 to 1.625, over two tiles.
pub struct Sheet {
    pub points: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    counts: Vec<u32>,
    indices: Vec<u32>,
}

impl Default for Sheet {
    fn default() -> Sheet {
        let place = |k: usize| [(k % (SIDE + 1)) as f32, (k / (SIDE + 1)) as f32];
        let corner = |k: usize| {
            let (face, corner) = (k / 4, k % 4);
            let first = face / SIDE * (SIDE + 1) + face % SIDE;
            (first + [0, 1, SIDE + 2, SIDE + 1][corner]) as u32
        };
        Sheet {
            points: (0..VERTICES).map(|k| [place(k)[0], place(k)[1], 0.0]).collect(),
            uvs: (0..VERTICES).map(|k| [0.125 + 0.5 * place(k)[0], 0.125 + 0.25 * place(k)[1]]).collect(),
            counts: vec![4; SIDE * SIDE],
            indices: (0..CORNERS).map(corner).collect(),
        }
    }
}

impl Sheet {
    pub fn positions(&self) -> vrtm_array {
        let mut array = sized::<vrtm_array>();
        array.data = self.points.as_ptr().cast();
        array.count = VERTICES;
        array
    }

    /// Makes an asset, with a grid of 16 x 16 in each tile.
    pub fn create(&self, device: vrtm_device, asset: &mut vrtm_asset) -> vrtm_status {
        let mut uvs = self.positions();
        uvs.data = self.uvs.as_ptr().cast();
        let positions = self.positions();
        let mut mesh = vrtm_mesh_desc::default();
        mesh.positions = &positions;
        mesh.face_counts = self.counts.as_ptr();
        mesh.face_count = self.counts.len();
        mesh.indices = self.indices.as_ptr();
        mesh.index_count = CORNERS;
        mesh.uvs = &uvs;
        mesh.uv_indices = self.indices.as_ptr();
        mesh.uv_index_count = CORNERS;
        // SAFETY: all pointers point to valid memory of the claimed size.
        unsafe {
            let status = vrtm_asset_create(device, &mesh, asset);
            if check(status) {
                small_grids(*asset);
            }
            status
        }
    }

    /// Bends the sheet by the fuzzer's numbers, and sometimes breaks it.
    pub fn bend(&mut self, input: &mut Input) {
        let rest = Sheet::default().points;
        for (point, rest) in self.points.iter_mut().zip(rest) {
            *point = [rest[0], rest[1], f32::from(input.any::<i8>().unwrap_or(0)) / 64.0];
        }
        if input.below(16) == 15 {
            let broken = input.below(VERTICES);
            self.points[broken][1] = input.number() as f32;
        }
    }
}

/// Without a map the grid is 1024 x 1024, which takes too long for a fuzzer.
///
/// # Safety
/// Any handle may be given.
pub unsafe fn small_grids(asset: vrtm_asset) {
    for index in 0..40 {
        let mut tile = vrtm_tile { id: 0 };
        let mut settings = vrtm_tile_settings::default();
        settings.grid_width = 16;
        settings.grid_height = 16;
        // SAFETY: all pointers are valid.
        unsafe {
            if vrtm_asset_get_tile(asset, index, &mut tile) != VRTM_OK {
                break;
            }
            check(vrtm_tile_set_settings(tile, &settings));
        }
    }
}

/// Mostly good options; the least work, as a rule.
pub fn options(input: &mut Input) -> vrtm_solve_options {
    let mut options = vrtm_solve_options::default();
    options.quality = input.odd(VRTM_QUALITY_DRAFT, &[VRTM_QUALITY_NORMAL, -1, 2]);
    options.warm = input.odd(0, &[1, 1, 2]);
    options.temporal_weight = input.odd(0.0, &[0.1, 1e6, -1.0, f32::NAN]);
    options.measure = input.odd(0, &[1, 1, 9]);
    options.tolerance = input.odd(0.0, &[0.5, 1.0, f32::NAN, -1.0]);
    options.time_budget_ms = input.odd(0.0, &[1e-3, 10.0, -1.0, f32::INFINITY]);
    options.max_corrections = input.odd(0, &[1, 2, 5, 65]);
    options.solver = input.odd(VRTM_SOLVER_DESCENT, &[VRTM_SOLVER_PBD, VRTM_SOLVER_PBD, 2, -1]);
    options.pbd.iterations = input.odd(1, &[3, 20]);
    options.threads = input.odd(0, &[1, 2, 5000]);
    options.release = input.odd(0, &[1, 2]);
    options.pbd.smoothing = input.odd(0.8, &[0.5, 0.0, 1.5, f32::NAN]);
    options
}
