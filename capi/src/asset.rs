//! Assets and the look-up of their tiles.

use super::desc;
use super::guard::{guard, guard_struct, guard_value};
use super::handle::{self, ASSETS, DEVICES, vrtm_asset, vrtm_device, vrtm_tile};
use super::mesh::{in_c_words, mesh, more_uvs, vrtm_mesh_desc};
use super::mirror::mirror;
use super::status::vrtm_status;
use vrtm::Asset;
use vrtm_core::report::AssetInfo;

mirror! {
    report vrtm_asset_info of r: AssetInfo {
        uv_sets: u32, tiles: u32, charts: u32,
        vertices: u64, faces: u64, corners: u64, triangles: u64,
        faces_untextured: u64, faces_skipped: u64, faces_outside: u64, clipped_faces: u64, degenerate_triangles: u64,
        border_edges: u64, welded_edges: u64, edges_apart: u64, seams_unused: u64,
    }
}

/// Makes an asset from a mesh. The caller destroys `*asset`; it may outlive `device`.
///
/// Errors: VRTM_ERROR_INVALID_ARGUMENT for an empty mesh, and for a face with UVs at some corners only.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_create(
    device: vrtm_device,
    desc: *const vrtm_mesh_desc,
    asset: *mut vrtm_asset,
) -> vrtm_status {
    guard_value("vrtm_asset_create", asset, "asset", || {
        let device = DEVICES.get("device", device.id)?;
        // SAFETY: the host's pointers, valid during the call.
        let (desc, uv_sets) = unsafe {
            let desc = desc::read(desc, "desc")?;
            (desc, more_uvs(&desc)?)
        };
        // SAFETY: as above.
        let mesh = unsafe { mesh(&desc, &uv_sets) }?;
        let asset = Asset::new(&device, &mesh).map_err(|error| in_c_words(error, &mesh))?;
        handle::add_asset(asset)
    })
}

/// Describes the mesh. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_get_info(asset: vrtm_asset, info: *mut vrtm_asset_info) -> vrtm_status {
    guard_struct("vrtm_asset_get_info", info, "info", || Ok(handle::asset(asset)?.info.into()))
}

/// Destroys an asset and all of its tile handles. If another thread or a job is using the asset, a solve is cancelled,
/// any other call runs to its end, and the memory is freed afterwards; this function does not wait. With a device's
/// last asset, free pages of the process's heap go back to the system (on Linux with glibc, by malloc_trim).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_destroy(asset: vrtm_asset) -> vrtm_status {
    guard("vrtm_asset_destroy", || {
        ASSETS.remove(asset.id)?.end();
        Ok(())
    })
}

/// The tile at `index`, 0 <= index < vrtm_asset_info.tiles, first those of UV set 0 in the order of their UDIM numbers,
/// then those of set 1, and so on; the layers of a UDIM number follow one another. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_get_tile(
    asset: vrtm_asset,
    index: u32,
    tile: *mut vrtm_tile,
) -> vrtm_status {
    guard_value("vrtm_asset_get_tile", tile, "tile", || {
        let tiles = handle::asset(asset)?.info.tiles;
        ensure!(index < tiles, "index is {index}, but the asset has {tiles} tiles");
        Ok(handle::tile_handle(asset, index as usize))
    })
}
