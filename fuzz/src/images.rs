//! Images of any layout, in memory of exactly the size that the layout spans: nothing beyond it is read or written, bytes
//! between the texels stay as they are, and a call that fails writes nothing.

use std::ptr;
use std::sync::LazyLock;

use super::{Input, Memory, Sheet, check, device, nowhere, options, sized};
use vrtm_capi::{asset::*, fetch::*, handle::*, map::*, solve::*, tile::*, types::*};

static DEVICE: LazyLock<vrtm_device> = LazyLock::new(|| device(1));
const UNTOUCHED: u8 = 0x5A;
/// Larger images teach the fuzzer nothing more.
const LARGEST: u128 = 1 << 16;

/// An image's layout, as the caller describes it.
struct Layout {
    format: i32,
    size: [u32; 2],
    pixel: usize,
    row: usize,
    origin: i32,
}

impl Layout {
    fn new(input: &mut Input, formats: &[i32], channels: usize) -> Layout {
        let format = input.pick(formats);
        let side = |input: &mut Input| match input.below(32) {
            0..=27 => 1 + input.below(40) as u32,
            28 => 0,
            _ => input.pick(&[100, 4096, 16384, 65536, 1 << 20, u32::MAX / 2, u32::MAX]),
        };
        let size = [side(input), side(input)];
        let texel = channels * bytes_of(format);
        let strides = [texel - 1, 1, texel * 40, 4096, usize::MAX, usize::MAX / 2, usize::MAX / 39, 1 << 32];
        let pixel = match input.below(4) {
            0 | 1 => 0,
            2 => texel + input.below(9),
            _ => input.pick(&strides),
        };
        let step = if pixel == 0 { texel } else { pixel };
        let row = match input.below(4) {
            0 | 1 => 0,
            2 => step.wrapping_mul(size[0] as usize).wrapping_add(input.below(9)),
            _ => input.pick(&strides),
        };
        let origin = input.odd(VRTM_ORIGIN_TOP, &[VRTM_ORIGIN_BOTTOM, VRTM_ORIGIN_BOTTOM, -1, 2]);
        Layout { format, size, pixel, row, origin }
    }

    /// The strides that zeros stand for.
    fn strides(&self, channels: usize) -> [u128; 2] {
        let texel = (channels * bytes_of(self.format)) as u128;
        let pixel = if self.pixel == 0 { texel } else { self.pixel as u128 };
        [pixel, if self.row == 0 { pixel * u128::from(self.size[0]) } else { self.row as u128 }]
    }

    /// Bytes from the first to the last; without end if the memory cannot be had, and none if that is only large.
    fn span(&self, channels: usize) -> Option<u128> {
        let [pixel, row] = self.strides(channels);
        let [width, height] = self.size.map(u128::from);
        let texel = (channels * bytes_of(self.format)) as u128;
        match width == 0 || height == 0 {
            true => Some(0),
            false => Some((height - 1) * row + (width - 1) * pixel + texel),
        }
        .filter(|&bytes| bytes <= LARGEST || bytes > isize::MAX as u128)
    }
}

fn bytes_of(format: i32) -> usize {
    match format {
        VRTM_PIXEL_F16 | VRTM_PIXEL_U16 => 2,
        VRTM_PIXEL_U8 => 1,
        _ => 4,
    }
}

/// An input image with its memory; none if that would be large.
fn image(input: &mut Input) -> Option<(Memory, vrtm_image)> {
    let formats = [VRTM_PIXEL_F32, VRTM_PIXEL_F16, VRTM_PIXEL_U16, VRTM_PIXEL_U8, VRTM_PIXEL_U8, -1, 4];
    let layout = Layout::new(input, &formats, 1);
    let bytes = layout.span(1)?;
    let mut memory = Memory::new(if bytes > LARGEST { 0 } else { bytes as usize }, input.below(2));
    let pattern: [u8; 4] =
        [input.pick(&[0, 0x3F, 0x7F, 0xFF]), input.pick(&[0, 0x80, 0xFF]), 0, input.any().unwrap_or(0)];
    let step = 1 + input.below(5);
    for (at, byte) in memory.bytes().iter_mut().enumerate() {
        *byte = pattern[at / step % 4];
    }
    let mut image = sized::<vrtm_image>();
    image.format = layout.format;
    [image.width, image.height] = layout.size;
    (image.pixel_stride, image.row_stride, image.origin) = (layout.pixel, layout.row, layout.origin);
    image.data = if bytes > LARGEST { nowhere() } else { memory.pointer() };
    if input.below(32) == 31 {
        image.data = ptr::null();
    }
    Some((memory, image))
}

/// An output image with its memory.
struct Target {
    memory: Memory,
    layout: Layout,
    c: vrtm_image_out,
}

impl Target {
    fn new(input: &mut Input) -> Option<Target> {
        let formats = [
            VRTM_PIXEL_F32,
            VRTM_PIXEL_F32,
            VRTM_PIXEL_F16,
            VRTM_PIXEL_F16,
            VRTM_PIXEL_U16,
            VRTM_PIXEL_U8,
            -1,
        ];
        let channels = 1 + input.below(4);
        let layout = Layout::new(input, &formats, channels);
        let bytes = layout.span(channels)?;
        let mut memory = Memory::new(if bytes > LARGEST { 0 } else { bytes as usize }, input.below(2));
        let mut c = sized::<vrtm_image_out>();
        (c.format, c.channels) = (layout.format, channels as u32);
        [c.width, c.height] = layout.size;
        (c.pixel_stride, c.row_stride, c.origin) = (layout.pixel, layout.row, layout.origin);
        c.data = if bytes > LARGEST { nowhere() } else { memory.pointer() };
        if input.below(32) == 31 {
            c.data = ptr::null_mut();
        }
        Some(Target { memory, layout, c })
    }

    /// What a call may have written.
    fn compare(&mut self, succeeded: bool) {
        let channels = self.c.channels as usize;
        let texel = channels * bytes_of(self.layout.format);
        let [pixel, row] = self.layout.strides(channels).map(|n| n as usize);
        let half = self.layout.format == VRTM_PIXEL_F16;
        let bytes = self.memory.bytes();
        if succeeded {
            for y in 0..self.layout.size[1] as usize {
                for x in 0..self.layout.size[0] as usize {
                    let texel = &mut bytes[y * row + x * pixel..][..texel];
                    // All bits of the exponent: an infinity or a NaN.
                    let finite = match half {
                        true => texel.chunks(2).all(|c| c[1] & 0x7C != 0x7C),
                        false => texel.chunks(4).all(|c| c[3] & 0x7F != 0x7F || c[2] & 0x80 == 0),
                    };
                    assert!(finite, "texel ({x}, {y}) is not finite");
                    texel.fill(UNTOUCHED);
                }
            }
        }
        assert!(bytes.iter().all(|&byte| byte == UNTOUCHED), "bytes beside the texels were written");
    }
}

/// One input.
pub fn run(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let mut sheet = Sheet::default();
    let (mut asset, mut tile) = (vrtm_asset { id: 0 }, vrtm_tile { id: 0 });
    assert!(check(sheet.create(*DEVICE, &mut asset)));
    sheet.bend(&mut input);
    // SAFETY: all pointers are null or point to memory of the claimed size; those to nowhere claim more than there can be.
    unsafe {
        assert!(check(vrtm_asset_get_tile(asset, 0, &mut tile)));
        for _ in 0..12 {
            if input.ended() {
                break;
            }
            step(&mut input, &sheet, asset, tile);
        }
        assert!(check(vrtm_asset_destroy(asset)));
    }
}

/// # Safety
/// Any handle may be given.
unsafe fn step(input: &mut Input, sheet: &Sheet, asset: vrtm_asset, tile: vrtm_tile) -> Option<()> {
    let kinds = [0, 1, 2, 3, 4, 5, -1, 6];
    let places = [0, 1, 2, 7, 39, 64, u32::MAX];
    // SAFETY: as above.
    unsafe {
        match input.below(9) {
            0 => {
                let (_memory, image) = image(input)?;
                check(vrtm_tile_set_rigidity(tile, &image));
            }
            1 => {
                let (_memory, image) = image(input)?;
                check(vrtm_tile_set_mask(tile, input.odd(&raw const image, &[ptr::null()])));
            }
            2 => {
                // A map, and a part of one of the same size and format, if the fuzzer finds such.
                let (_memory, image) = image(input)?;
                if input.below(4) != 3 {
                    check(vrtm_tile_set_rigidity(tile, &image));
                }
                let [x, y, width, height] = [(); 4].map(|()| input.pick(&places));
                check(vrtm_tile_update_rigidity(tile, &image, x, y, width, height));
            }
            3 | 4 => {
                let mut target = Target::new(input)?;
                let mut fetch = sized::<vrtm_fetch>();
                (fetch.kind, fetch.tile, fetch.image) = (input.pick(&kinds), tile, &target.c);
                let done = check(vrtm_asset_fetch(&fetch, 1));
                target.compare(done);
            }
            5 => {
                let mut target = Target::new(input)?;
                let [x, y] = [(); 2].map(|()| input.pick(&places));
                let mut fetch = sized::<vrtm_fetch>();
                (fetch.x, fetch.y) = (x, y);
                (fetch.whole_width, fetch.whole_height) = (input.pick(&places), input.pick(&places));
                (fetch.kind, fetch.tile, fetch.image) = (input.pick(&kinds), tile, &target.c);
                let done = check(vrtm_asset_fetch(&fetch, 1));
                target.compare(done);
            }
            6 => {
                let (mut one, mut other) = (Target::new(input)?, Target::new(input)?);
                let mut fetches = [sized::<vrtm_fetch>(), sized::<vrtm_fetch>()];
                for (fetch, target) in fetches.iter_mut().zip([&one, &other]) {
                    fetch.kind = input.pick(&kinds);
                    fetch.tile = tile;
                    fetch.image = &target.c;
                }
                let options = options(input);
                let done =
                    check(vrtm_asset_redirect(asset, &sheet.positions(), &options, fetches.as_ptr(), 2));
                one.compare(done);
                other.compare(done);
            }
            7 => {
                let mut desc = sized::<vrtm_map_desc>();
                [desc.width, desc.height] = [(); 2].map(|()| input.odd(33, &[0, 1, 2, 200, 20_000]));
                desc.kind = input.pick(&kinds);
                desc.format = input.pick(&[VRTM_PIXEL_F32, VRTM_PIXEL_F16, VRTM_PIXEL_U8, -1]);
                let mut data = sized::<vrtm_map_info>();
                if check(vrtm_tile_inspect_map(tile, &desc, &mut data)) {
                    assert!(data.error_rms <= data.error_max && data.error_p99 <= data.error_max);
                    assert!((data.folds == 0) == (data.min_jacobian > 0.0));
                }
            }
            _ => {
                check(vrtm_asset_solve(asset, &sheet.positions(), &options(input)));
            }
        }
    }
    Some(())
}
