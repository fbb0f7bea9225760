//! Estimating what it takes to prepare a tile; saving and loading prepared tiles.

use std::ffi::c_void;

use super::desc;
use super::guard::{guard, guard_struct, guard_value};
use super::handle::{self, vrtm_tile};
use super::mirror::mirror;
use super::status::vrtm_status;
use vrtm_core::report::TileEstimate;

mirror! {
    report vrtm_tile_estimate of r: TileEstimate {
        movable_nodes: u64, prepared_bytes: u64, preparing_bytes: u64, solving_bytes: u64,
    }
}

/// Estimates, to about a tenth, what preparing and solving a tile would take with its present maps and settings (on a
/// grid of less than 1024 x 1024 cells, `prepared_bytes` may be a third too low). Takes a small fraction of the time
/// and memory of preparing the tile, and keeps nothing but the charts' extensions with VRTM_SEAMS_CONTINUE or
/// VRTM_OPEN_BORDERS_SLIDE. The same estimate is checked against a device's memory_budget before a tile is prepared.
///
/// Errors: VRTM_ERROR_BUSY; VRTM_ERROR_UNSUPPORTED if the GPU's buffers are too small for the grid, with the largest
/// size that fits, as in all calls that prepare a tile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_get_estimate(
    tile: vrtm_tile,
    estimate: *mut vrtm_tile_estimate,
) -> vrtm_status {
    guard_struct("vrtm_tile_get_estimate", estimate, "estimate", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        Ok(asset.write(|asset| Ok(asset.tile_mut(tile).estimate()?))?.into())
    })
}

/// Writes a prepared tile to the host's memory, for vrtm_tile_load on another machine or in a later session. Prepares
/// the tile if necessary. `size` gets the number of bytes: call once with `data` null and `capacity` 0 to learn it,
/// then with a buffer of that size. The bytes hold what is derived from mesh, maps and settings, not the mesh, maps and
/// settings themselves.
///
/// Errors: VRTM_ERROR_INVALID_ARGUMENT if `data` is neither null nor large enough; VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_save(
    tile: vrtm_tile,
    data: *mut c_void,
    capacity: usize,
    size: *mut usize,
) -> vrtm_status {
    guard_value("vrtm_tile_save", size, "size", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        let needed = asset.write(|asset| Ok(asset.tile_mut(tile).saved_size()?))?;
        if !data.is_null() {
            ensure!(capacity >= needed, "capacity is {capacity} bytes, {needed} are needed");
            // SAFETY: the host vouches for `capacity` bytes during the call.
            let out = unsafe { desc::slice_mut(data.cast::<u8>(), needed, "data") }?;
            asset.write(|asset| Ok(asset.tile_mut(tile).save_to(out)?))?;
        }
        Ok(needed)
    })
}

/// Loads a tile that was prepared elsewhere, so that it need not be prepared here. Before this call, set the mesh, maps
/// and settings that the tile was saved with; they are compared. `size` is the number of bytes. The bytes need not be
/// trusted: anything but an intact saved tile is refused. The checksum is no signature: bytes that were forged together
/// with it may give a different warp, which is certified like any other.
///
/// Errors: VRTM_ERROR_INVALID_ARGUMENT for bytes that are damaged, in another version of the format, or saved with
/// another mesh, map or setting; VRTM_ERROR_BUSY. On any error the tile is as before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_load(tile: vrtm_tile, data: *const c_void, size: usize) -> vrtm_status {
    guard("vrtm_tile_load", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        ensure!(!data.is_null(), "data is null");
        // SAFETY: the host vouches for `size` bytes during the call.
        let data = unsafe { desc::slice(data.cast::<u8>(), size, "data") }?;
        asset.write(|asset| Ok(asset.tile_mut(tile).load(data)?))
    })
}
