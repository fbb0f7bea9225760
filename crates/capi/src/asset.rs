//! Assets and the look-up of their tiles.

use super::desc::{self, Out, Place};
use super::guard::guard;
use super::handle::{self, vrtm_asset, vrtm_device, vrtm_tile};
use super::mesh::{in_c_words, mesh, more_uvs, vrtm_mesh_desc};
use super::mirror::mirror;
use super::status::{Failure, Outcome, vrtm_status};
use vrtm::Asset;
use vrtm_core::report::AssetInfo;

mirror! {
    report vrtm_asset_data of r: AssetInfo {
        uv_sets: u32, tiles: u32, charts: u32,
        vertices: u64, faces: u64, corners: u64, triangles: u64,
        faces_untextured: u64, faces_skipped: u64, faces_outside: u64, clipped_faces: u64, degenerate_triangles: u64,
        border_edges: u64, welded_edges: u64, edges_apart: u64, seams_unused: u64,
    }
}

/// Makes an asset from a mesh. The caller destroys `*asset`; it may outlive `device`.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT, naming the array and the index, for null, an
/// index out of range, a value that is not finite, counts that do not add up, a face with UVs at some corners only, a
/// setting out of range or an empty mesh; VRTM_ERROR_OUT_OF_MEMORY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_create(
    device: vrtm_device,
    desc: *const vrtm_mesh_desc,
    asset: *mut vrtm_asset,
) -> vrtm_status {
    guard("vrtm_asset_create", || {
        let out = Place::new(asset, "asset")?;
        let device = handle::device(device)?;
        // SAFETY: the host's pointers, valid during the call.
        let (desc, uv_sets) = unsafe {
            let desc = desc::read(desc, "desc")?;
            (desc, more_uvs(&desc)?)
        };
        // SAFETY: as above.
        let mesh = unsafe { mesh(&desc, &uv_sets) }?;
        let asset = Asset::new(&device, &mesh).map_err(|error| in_c_words(error, &mesh))?;
        out.write(handle::add_asset(asset)?);
        Ok(())
    })
}

/// Describes the mesh. Never busy.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `info` is null or has a wrong struct_size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_info(asset: vrtm_asset, info: *mut vrtm_asset_data) -> vrtm_status {
    guard("vrtm_asset_info", || {
        let out = Out::new(info, "info")?;
        out.write(handle::asset(asset)?.info.into());
        Ok(())
    })
}

/// Destroys an asset and all of its tile handles. If another thread or a job is using the asset, a solve is cancelled,
/// any other call runs to its end, and the memory is freed afterwards; this function does not wait. With a device's
/// last asset, free pages of the process's heap go back to the system (on Linux with glibc, by malloc_trim).
///
/// Errors: VRTM_ERROR_INVALID_HANDLE, also when it was destroyed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_destroy(asset: vrtm_asset) -> vrtm_status {
    guard("vrtm_asset_destroy", || handle::remove_asset(asset))
}

/// Number of tiles with at least one triangle. Never busy.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `count` is null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_tile_count(asset: vrtm_asset, count: *mut u32) -> vrtm_status {
    guard("vrtm_asset_tile_count", || {
        let out = Place::new(count, "count")?;
        let tiles = handle::asset(asset)?.tile_count();
        out.write(u32::try_from(tiles).unwrap_or(u32::MAX));
        Ok(())
    })
}

/// The tile at `index`, 0 <= index < vrtm_asset_tile_count, first those of UV set 0 in the order of their UDIM numbers,
/// then those of set 1, and so on; the layers of a UDIM number follow one another. Never busy.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT for an index out of range or if `tile` is null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_tile(asset: vrtm_asset, index: u32, tile: *mut vrtm_tile) -> vrtm_status {
    guard("vrtm_asset_tile", || {
        let out = Place::new(tile, "tile")?;
        let tiles = handle::asset(asset)?.tile_count();
        if index as usize >= tiles {
            return Err(Failure::argument(format!("index is {index}, but the asset has {tiles} tiles")));
        }
        out.write(handle::tile_handle(asset, index as usize));
        Ok(())
    })
}

/// The tile with a UDIM number (1001 + U + 10 V) in UV set 0; if it has layers, layer 0.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if the mesh has no triangle there or `tile` is
/// null. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_find_tile(
    asset: vrtm_asset,
    udim: u32,
    tile: *mut vrtm_tile,
) -> vrtm_status {
    guard("vrtm_asset_find_tile", || find_tile(asset, 0, udim, 0, tile))
}

/// The tile with a UDIM number in the UV set `uv_set`, 0 <= uv_set < vrtm_asset_data.uv_sets.
///
/// Errors: those of vrtm_asset_find_tile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_find_tile_of_set(
    asset: vrtm_asset,
    uv_set: u32,
    udim: u32,
    tile: *mut vrtm_tile,
) -> vrtm_status {
    guard("vrtm_asset_find_tile_of_set", || find_tile(asset, uv_set, udim, 0, tile))
}

/// A layer of the tile with a UDIM number: `layer` is less than the `layers` of vrtm_tile_layer.
///
/// Errors: those of vrtm_asset_find_tile_of_set; VRTM_ERROR_INVALID_ARGUMENT if the tile has no such layer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_find_tile_of_layer(
    asset: vrtm_asset,
    uv_set: u32,
    udim: u32,
    layer: u32,
    tile: *mut vrtm_tile,
) -> vrtm_status {
    guard("vrtm_asset_find_tile_of_layer", || find_tile(asset, uv_set, udim, layer, tile))
}

fn find_tile(asset: vrtm_asset, uv_set: u32, udim: u32, layer: u32, tile: *mut vrtm_tile) -> Outcome<()> {
    let out = Place::new(tile, "tile")?;
    let shared = handle::asset(asset)?;
    let sets = shared.info.uv_sets;
    if uv_set >= sets {
        return Err(Failure::argument(format!("uv_set is {uv_set}, but the mesh has {sets} UV sets")));
    }
    let found = shared.results.find_tile_of_set(uv_set, udim);
    let index = found.ok_or_else(|| Failure::argument(format!("udim: the asset has no tile {udim}")))?;
    let layers = shared.results.tile_layer(index).1;
    if layer >= layers {
        return Err(Failure::argument(format!("layer is {layer}, but tile {udim} has {layers}")));
    }
    out.write(handle::tile_handle(asset, index + layer as usize));
    Ok(())
}
