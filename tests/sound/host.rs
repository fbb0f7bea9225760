//! What a host of the C functions has: a small sheet and memory of exactly the size that a call may touch.

use std::ffi::{CStr, c_void};
use std::mem::{size_of, zeroed};
use std::ptr;

use vrtm_capi::{asset::*, handle::*, mesh::*, solve::*, status::*, tile::*, types::*};

/// A struct of the C API with its size field set and all else zero.
pub fn sized<T: Copy>() -> T {
    // SAFETY: plain data, for which all zeros are a valid value; each of these structs starts with its size.
    unsafe {
        let mut value: T = zeroed();
        ptr::from_mut(&mut value).cast::<u32>().write(size_of::<T>() as u32);
        value
    }
}

/// Fails with the library's message, unless the call succeeded.
#[track_caller]
pub fn done(status: vrtm_status) {
    // SAFETY: a zero-terminated line of this thread.
    let message = || unsafe { CStr::from_ptr(vrtm_last_error()) }.to_string_lossy().into_owned();
    assert!(status == VRTM_OK, "status {status}: {}", message());
}

/// The least work, with either solver.
pub fn least() -> vrtm_solve_options {
    let mut options = vrtm_solve_options { max_corrections: 1, ..vrtm_solve_options::default() };
    options.pbd.iterations = 1;
    options
}

/// Cells per side of a tile's grid. Miri takes minutes for a solve with two levels.
pub const GRID: u32 = if cfg!(miri) { 8 } else { 16 };
/// Quads per side of the sheet.
const SIDE: usize = 3;
pub const VERTICES: usize = (SIDE + 1) * (SIDE + 1);
pub const FACES: usize = SIDE * SIDE;
pub const CORNERS: usize = 4 * FACES;

/// Bytes that begin anywhere in a word.
pub struct Bytes {
    bytes: Box<[u8]>,
    skipped: usize,
}

impl Bytes {
    pub fn new(size: usize, skipped: usize) -> Bytes {
        Bytes { bytes: vec![0x5A; size + skipped].into(), skipped }
    }

    pub fn get(&self) -> &[u8] {
        &self.bytes[self.skipped..]
    }

    pub fn pointer(&mut self) -> *mut c_void {
        self.bytes[self.skipped..].as_mut_ptr().cast()
    }
}

/// Vectors at an odd address, with an odd number of bytes between them.
pub struct Array {
    memory: Bytes,
    stride: usize,
    count: usize,
}

impl Array {
    pub fn new<const N: usize>(values: &[[f32; N]]) -> Array {
        let stride = 4 * N + 3;
        let mut memory = Bytes::new((values.len() - 1) * stride + 4 * N, 1);
        for (k, value) in values.iter().enumerate() {
            for (component, number) in value.iter().enumerate() {
                let at = 1 + k * stride + 4 * component;
                memory.bytes[at..at + 4].copy_from_slice(&number.to_ne_bytes());
            }
        }
        Array { memory, stride, count: values.len() }
    }

    pub fn c(&mut self) -> vrtm_array {
        vrtm_array { data: self.memory.pointer(), stride: self.stride, count: self.count, ..sized() }
    }
}

/// The sheet's vertices, bent by `bend`. Its u runs from 0.125 to 1.625, over two tiles.
pub fn pose(bend: f32) -> Array {
    let point = |k: usize| {
        let (x, y) = ((k % (SIDE + 1)) as f32, (k / (SIDE + 1)) as f32);
        [x * (1.0 + 0.2 * bend * y), y, bend * x * x]
    };
    Array::new(&(0..VERTICES).map(point).collect::<Vec<_>>())
}

/// An asset with two tiles, each with a painted feature.
pub fn asset(device: vrtm_device) -> (vrtm_asset, [vrtm_tile; 2]) {
    let uv = |k: usize| [0.125 + 0.5 * (k % (SIDE + 1)) as f32, 0.125 + 0.25 * (k / (SIDE + 1)) as f32];
    let (mut positions, mut uvs) = (pose(0.0), Array::new(&(0..VERTICES).map(uv).collect::<Vec<_>>()));
    let corner = |k: usize| {
        let (face, corner) = (k / 4, k % 4);
        (face / SIDE * (SIDE + 1) + face % SIDE + [0, 1, SIDE + 2, SIDE + 1][corner]) as u32
    };
    let (counts, indices) = ([4; FACES], (0..CORNERS).map(corner).collect::<Box<[u32]>>());
    let (positions, uvs) = (positions.c(), uvs.c());
    let mesh = vrtm_mesh_desc {
        positions: &positions,
        face_counts: counts.as_ptr(),
        face_count: FACES,
        indices: indices.as_ptr(),
        index_count: CORNERS,
        uvs: &uvs,
        uv_indices: indices.as_ptr(),
        uv_index_count: CORNERS,
        ..vrtm_mesh_desc::default()
    };
    let (mut asset, mut tiles) = (vrtm_asset { id: 0 }, [vrtm_tile { id: 0 }; 2]);
    let settings = vrtm_tile_settings {
        grid_width: GRID,
        grid_height: GRID,
        seams: VRTM_SEAMS_KEEP,
        ..vrtm_tile_settings::default()
    };
    // SAFETY: all pointers point to memory of the size that the structs tell.
    unsafe {
        done(vrtm_asset_create(device, &mesh, &mut asset));
        for (tile, udim) in tiles.iter_mut().zip([1001, 1002]) {
            let key = vrtm_tile_key { udim, ..vrtm_tile_key::default() };
            done(vrtm_asset_find_tile(asset, &key, tile));
            done(vrtm_tile_set_settings(*tile, &settings));
            paint(*tile);
        }
    }
    (asset, tiles)
}

/// Gives a tile a rigidity map: a square in its middle, one channel of three.
pub fn paint(tile: vrtm_tile) {
    let mut texels = Bytes::new(7 * 26 + 7 * 3 + 1, 1);
    texels.bytes[1..].fill(0);
    for k in (0..8).flat_map(|y| (2..6).map(move |x| 26 * y + 3 * x)) {
        texels.bytes[1 + k] = 255;
    }
    let image = vrtm_image {
        format: VRTM_PIXEL_U8,
        data: texels.pointer(),
        width: 8,
        height: 8,
        pixel_stride: 3,
        row_stride: 26,
        ..sized()
    };
    // SAFETY: the image spans its memory.
    done(unsafe { vrtm_tile_set_rigidity(tile, &image) });
}

/// An image of 9 x 7 texels with gaps between texels and between rows, at an odd address.
pub struct Image {
    memory: Bytes,
    texel: usize,
    pub c: vrtm_image_out,
}

impl Image {
    const WIDTH: usize = 9;
    const HEIGHT: usize = 7;

    pub fn new(format: vrtm_pixel_format, channels: u32) -> Image {
        let texel = channels as usize * if format == VRTM_PIXEL_F32 { 4 } else { 2 };
        let pixel = texel + 1;
        let row = Image::WIDTH * pixel + 5;
        let mut memory = Bytes::new((Image::HEIGHT - 1) * row + (Image::WIDTH - 1) * pixel + texel, 1);
        let c = vrtm_image_out {
            format,
            channels,
            width: Image::WIDTH as u32,
            height: Image::HEIGHT as u32,
            data: memory.pointer(),
            pixel_stride: pixel,
            row_stride: row,
            ..sized()
        };
        Image { memory, texel, c }
    }

    /// Fails if a byte between texels was written, or every texel is as it was.
    #[track_caller]
    pub fn check(&self) {
        let (row, pixel) = (self.c.row_stride, self.c.pixel_stride);
        let within = |at: usize| at % row % pixel < self.texel && at % row / pixel < Image::WIDTH;
        let bytes = || self.memory.get().iter().enumerate();
        assert!(bytes().all(|(at, &byte)| byte == 0x5A || within(at)));
        assert!(bytes().any(|(_, &byte)| byte != 0x5A));
    }
}
