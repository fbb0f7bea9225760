//! Bytes that claim to be a saved tile: any, or a saved tile with changes whose length and checksum were put right, as a
//! forger would. They are refused, or give an asset that solves; never an access out of bounds.

use std::ptr;
use std::sync::LazyLock;

use super::{Input, Sheet, check, device, options, sized};
use vrtm_capi::{asset::*, fetch::*, handle::*, prepare::*, report::*, solve::*, tile::*, types::*};

/// Where the length, the checksum and what it is taken of begin (crates/core/src/grid/saved.rs).
const LENGTH: usize = 16;
const CHECKSUM: usize = 40;
const PAYLOAD: usize = 56;

static DEVICE: LazyLock<vrtm_device> = LazyLock::new(|| device(1));
static SAVED: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let (asset, tile) = make();
    let mut size = 0;
    // SAFETY: all pointers point to memory of the claimed size.
    unsafe {
        assert!(check(vrtm_tile_save(tile, ptr::null_mut(), 0, &mut size)));
        let mut bytes = vec![0_u8; size];
        assert!(check(vrtm_tile_save(tile, bytes.as_mut_ptr().cast(), size, &mut size)));
        assert!(check(vrtm_asset_destroy(asset)));
        bytes
    }
});

/// An asset with rigidity in its first tile.
fn make() -> (vrtm_asset, vrtm_tile) {
    let (mut asset, mut tile) = (vrtm_asset { id: 0 }, vrtm_tile { id: 0 });
    assert!(check(Sheet::default().create(*DEVICE, &mut asset)));
    let texels: Vec<u8> =
        (0..256).map(|k| if k % 16 / 3 % 2 == 1 && k / 48 % 2 == 1 { 255 } else { 0 }).collect();
    let mut image = sized::<vrtm_image>();
    (image.width, image.height, image.format) = (16, 16, VRTM_PIXEL_U8);
    image.data = texels.as_ptr().cast();
    // SAFETY: all pointers point to memory of the claimed size.
    unsafe {
        assert!(check(vrtm_asset_get_tile(asset, 0, &mut tile)));
        assert!(check(vrtm_tile_set_rigidity(tile, &image)));
    }
    (asset, tile)
}

/// One input.
pub fn run(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let data = match input.below(8) {
        0 => input.rest().to_vec(),
        kind => {
            let mut data = SAVED.clone();
            for _ in 0..input.below(12) {
                let first = if kind < 6 { PAYLOAD } else { 0 };
                if data.len() <= first {
                    break;
                }
                let at = first + input.below(data.len() - first);
                let value: u8 = input.any().unwrap_or(0);
                match input.below(16) {
                    13 if data.len() > PAYLOAD + 64 => drop(data.remove(at)),
                    14 => data.insert(at, value),
                    15 if data.len() > PAYLOAD + 64 => data.truncate(at.max(PAYLOAD)),
                    n if n < 4 => data[at] = value,
                    n if n < 6 => data[at] ^= 1 << (value % 8),
                    n => {
                        // A number of four bytes.
                        let number =
                            [0, 1, u32::MAX, 1 << 31, 0x7F80_0000, 0x3F80_0000, u32::from(value)][n % 7];
                        let end = (at + 4).min(data.len());
                        data[at..end].copy_from_slice(&number.to_le_bytes()[..end - at]);
                    }
                }
            }
            if kind != 7 {
                let length = (data.len() as u64).to_le_bytes();
                data[LENGTH..LENGTH + 8].copy_from_slice(&length);
                let sum = xxhash_rust::xxh3::xxh3_128(&data[PAYLOAD..]).to_le_bytes();
                data[CHECKSUM..PAYLOAD].copy_from_slice(&sum);
            }
            data
        }
    };
    let (asset, tile) = make();
    let mut sheet = Sheet::default();
    sheet.bend(&mut input);
    let options = options(&mut input);
    let mut map = [f32::NAN; 2 * 7 * 7];
    let mut image = sized::<vrtm_image_out>();
    (image.width, image.height) = (7, 7);
    image.data = map.as_mut_ptr().cast();
    // SAFETY: all pointers point to memory of the claimed size.
    unsafe {
        let loaded = check(vrtm_tile_load(tile, data.as_ptr().cast(), data.len()));
        assert!(loaded || data != *SAVED, "a saved tile is refused");
        if check(vrtm_asset_solve(asset, &sheet.positions(), &options)) {
            let mut report = sized::<vrtm_tile_report>();
            assert!(check(vrtm_tile_get_report(tile, &mut report)));
            let certified = report.folds == 0 && report.min_jacobian > 0.0;
            assert!(certified || options.solver != VRTM_SOLVER_DESCENT, "{} folds", report.folds);
            let mut fetch = sized::<vrtm_fetch>();
            (fetch.tile, fetch.image) = (tile, &image);
            check(vrtm_asset_fetch(&fetch, 1));
        }
        let mut needs = sized::<vrtm_tile_estimate>();
        check(vrtm_tile_get_estimate(tile, &mut needs));
        assert!(check(vrtm_asset_destroy(asset)));
    }
}
