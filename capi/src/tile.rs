//! A tile's facts, maps and settings.

use super::desc;
use super::guard::{guard, guard_struct, guard_value};
use super::handle::{self, vrtm_asset, vrtm_tile};
use super::mirror::{Mirror, choice, mirror};
use super::status::{Failure, vrtm_status};
use super::types::{image_or_none, strided_or_none, vrtm_array, vrtm_image};
use vrtm_core::report::TileInfo;
use vrtm_core::settings::{OpenBorders, Overlap, Seams, TileSettings};

mirror! {
    report vrtm_tile_info of r: TileInfo {
        udim: u32, uv_set: u32, layer: u32, layers: u32, charts: u32,
        triangles: u64, border_edges: u64, welded_edges: u64, edges_apart: u64,
        grid_width: u32 = r.grid[0], grid_height: u32 = r.grid[1],
        movable_nodes: u64, overlap: f32, fixed: f32,
        rigid_nodes: u64, rigid_overlapped: u64, gap_nodes: u64,
    }
}

choice! {
    OVERLAPS: vrtm_overlap of Overlap { VRTM_OVERLAP_FIXED = 0: Fixed, VRTM_OVERLAP_FIRST_FACE = 1: FirstFace }
}

choice! {
    SEAMS: vrtm_seams of Seams {
        VRTM_SEAMS_SHUT = 0: Shut, VRTM_SEAMS_CONTINUE = 1: Continue, VRTM_SEAMS_KEEP = 2: Keep,
    }
}

choice! {
    OPEN_BORDERS: vrtm_open_borders of OpenBorders {
        VRTM_OPEN_BORDERS_FIXED = 0: Fixed, VRTM_OPEN_BORDERS_SLIDE = 1: Slide,
    }
}

mirror! {
    settings vrtm_tile_settings of s: TileSettings in "settings" {
        grid_width: u32 = s.grid[0], grid_height: u32 = s.grid[1],
        overlap: vrtm_overlap,
        smoothness: f32, smoothness_floor: f32, orientation: f32, orientation_density: f32, room: f32, room_threshold: f32,
        seams: vrtm_seams, seam_reach: f32, open_borders: vrtm_open_borders, harm: f32,
    }
}

/// Names a tile. A plain value that never grows.
#[repr(C)]
#[derive(Clone, Copy, Default)]
pub struct vrtm_tile_key {
    /// UDIM number: 1001 + U + 10 V.
    pub udim: u32,
    /// UV set: 0 <= uv_set < vrtm_asset_info.uv_sets.
    pub uv_set: u32,
    /// Layer within the UDIM number: 0 <= layer < layers.
    pub layer: u32,
    /// Layers of the UDIM number: 1, or up to vrtm_mesh_desc.max_layers. vrtm_asset_find_tile ignores it.
    pub layers: u32,
}

/// Gets the key of a tile. Layers share their maps and settings: what is set for one of them holds for all. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_get_key(tile: vrtm_tile, key: *mut vrtm_tile_key) -> vrtm_status {
    guard_value("vrtm_tile_get_key", key, "key", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        let tile = asset.results.tile(tile);
        let (layer, layers) = tile.layer();
        Ok(vrtm_tile_key { udim: tile.udim(), uv_set: tile.uv_set(), layer, layers })
    })
}

/// The tile of an asset with a key: one of UV set 0 without layers needs only `key->udim`, all else zero. Never busy.
///
/// Errors: VRTM_ERROR_INVALID_ARGUMENT if there is no such tile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_find_tile(
    asset: vrtm_asset,
    key: *const vrtm_tile_key,
    tile: *mut vrtm_tile,
) -> vrtm_status {
    guard_value("vrtm_asset_find_tile", tile, "tile", || {
        let shared = handle::asset(asset)?;
        // SAFETY: the host's pointer.
        let vrtm_tile_key { udim, uv_set, layer, .. } = unsafe { desc::slice(key, 1, "key") }?[0];
        let sets = shared.info.uv_sets;
        ensure!(uv_set < sets, "key.uv_set is {uv_set}, but the mesh has {sets} UV sets");
        let found = shared.results.find_tile_of_set(uv_set, udim);
        let index =
            found.ok_or_else(|| Failure::argument(format!("key.udim: the asset has no tile {udim}")))?;
        let layers = shared.results.tile(index).layer().1;
        ensure!(layer < layers, "key.layer is {layer}, but tile {udim} has {layers} layers");
        Ok(handle::tile_handle(asset, index + layer as usize))
    })
}

/// Size of a grid. A plain value that never grows.
#[repr(C)]
#[derive(Clone, Copy, Default)]
pub struct vrtm_tile_grid {
    /// Cells in u.
    pub width: u32,
    /// Cells in v.
    pub height: u32,
}

/// Gets the grid that a tile has with its present rigidity and settings: where vrtm_tile_settings.grid_width or
/// grid_height is 0, the cells that resolve the rigid features. Unlike vrtm_tile_get_info, it does not prepare the
/// tile: it takes some milliseconds after a change of the rigidity.
///
/// Errors: VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_get_grid(tile: vrtm_tile, grid: *mut vrtm_tile_grid) -> vrtm_status {
    guard_value("vrtm_tile_get_grid", grid, "grid", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        let [width, height] = asset.write(|asset| Ok(asset.tile_mut(tile).grid()?))?;
        Ok(vrtm_tile_grid { width, height })
    })
}

/// Describes a tile. The first call, and the first after a change of map or settings, builds the tile's
/// grid, which takes time.
///
/// Errors: VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_get_info(tile: vrtm_tile, info: *mut vrtm_tile_info) -> vrtm_status {
    guard_struct("vrtm_tile_get_info", info, "info", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        Ok(asset.write(|asset| Ok(asset.tile_mut(tile).info()?))?.into())
    })
}

/// Sets a tile's rigidity, for all of its layers: 0 is infinitely elastic, 1 as rigid as possible; values outside are
/// clamped. The map may have any size; it is resampled to the grid. Null removes the map. A tile without one has the
/// rigidity of the vertices (vrtm_asset_set_vertex_rigidity), and without that, too, does not move at all. The last
/// result stays readable until the next solve. Only what depends on the rigidity is computed again, and charts whose
/// rigidity stays the same keep their results; the tile is prepared from the start where a chart gains its first
/// rigidity or loses its last, or where the grid gets another size.
///
/// Errors: VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_set_rigidity(tile: vrtm_tile, rigidity: *const vrtm_image) -> vrtm_status {
    guard("vrtm_tile_set_rigidity", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        // SAFETY: the host's pointer, valid during the call.
        let image = unsafe { image_or_none(rigidity, "rigidity") }?;
        asset.write(|asset| Ok(asset.tile_mut(tile).set_rigidity(image)?))
    })
}

/// Updates a part of a tile's rigidity map, for instance after a brush stroke: `width` x `height` texels from the
/// column `x` and the row `y`, in memory order. `rigidity` describes the whole map, with the size and the format of the
/// one that was set; its other texels are not read. Updating a small part takes a small fraction of the time of setting
/// the map, unless the tile has to be prepared from the start (vrtm_tile_set_rigidity).
///
/// Errors: VRTM_ERROR_INVALID_ARGUMENT if the tile has no map of this size and format; VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_update_rigidity(
    tile: vrtm_tile,
    rigidity: *const vrtm_image,
    x: u32,
    y: u32,
    width: u32,
    height: u32,
) -> vrtm_status {
    guard("vrtm_tile_update_rigidity", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        // SAFETY: the host's pointer, valid during the call.
        let image = unsafe { image_or_none(rigidity, "rigidity") }?
            .ok_or_else(|| Failure::argument("rigidity is null"))?;
        asset.write(|asset| Ok(asset.tile_mut(tile).update_rigidity(image, [x, y], [width, height])?))
    })
}

/// Sets a tile's warp mask: points under a texel below 0.5 do not move. Null removes it. A tile without one has the
/// mask of the vertices (vrtm_asset_set_vertex_mask), and without that, too, all may move: the default. In other
/// respects as vrtm_tile_set_rigidity.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_set_mask(tile: vrtm_tile, mask: *const vrtm_image) -> vrtm_status {
    guard("vrtm_tile_set_mask", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        // SAFETY: the host's pointer, valid during the call.
        let image = unsafe { image_or_none(mask, "mask") }?;
        asset.write(|asset| Ok(asset.tile_mut(tile).set_mask(image)?))
    })
}

/// Sets the rigidity of the vertices (1 component, as many as vertices, 0..1), linear over each triangle. A tile with
/// a map (vrtm_tile_set_rigidity) has that of its map, in whatever order the two are set. Null removes the values and
/// leaves the maps. Without a map, the grid is chosen in the same way, up to 1024 x 1024 cells.
///
/// Errors: VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_set_vertex_rigidity(
    asset: vrtm_asset,
    rigidity: *const vrtm_array,
) -> vrtm_status {
    guard("vrtm_asset_set_vertex_rigidity", || {
        let asset = handle::asset(asset)?;
        // SAFETY: the host's pointer, valid during the call.
        let values = unsafe { strided_or_none(rigidity, 1, "rigidity") }?;
        asset.write(|asset| Ok(asset.set_vertex_rigidity(values)?))
    })
}

/// Sets the warp mask of the vertices (1 component, as many as vertices), linear over each triangle: points below 0.5
/// do not move. A tile with a mask (vrtm_tile_set_mask) has its own, in whatever order the two are set. Null removes
/// the values and leaves the tiles' masks.
///
/// Errors: those of vrtm_asset_set_vertex_rigidity.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_set_vertex_mask(
    asset: vrtm_asset,
    mask: *const vrtm_array,
) -> vrtm_status {
    guard("vrtm_asset_set_vertex_mask", || {
        let asset = handle::asset(asset)?;
        // SAFETY: the host's pointer, valid during the call.
        let values = unsafe { strided_or_none(mask, 1, "mask") }?;
        asset.write(|asset| Ok(asset.set_vertex_mask(values)?))
    })
}

/// Sets a tile's settings, for all of its layers. Null: all defaults.
///
/// Errors: VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_set_settings(
    tile: vrtm_tile,
    settings: *const vrtm_tile_settings,
) -> vrtm_status {
    guard("vrtm_tile_set_settings", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        // SAFETY: the host's pointer, valid during the call.
        let new: vrtm_tile_settings = unsafe { desc::read_or_default(settings, "settings") }?;
        let new = new.settings()?;
        asset.write(|asset| Ok(asset.tile_mut(tile).set_settings(&new)?))
    })
}

/// Gets a tile's settings, as set or the defaults. The struct can be passed to vrtm_tile_set_settings unchanged.
///
/// Errors: VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_get_settings(
    tile: vrtm_tile,
    settings: *mut vrtm_tile_settings,
) -> vrtm_status {
    guard_struct("vrtm_tile_get_settings", settings, "settings", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        let now = asset.write(|asset| Ok(asset.tile_mut(tile).settings()?))?;
        Ok((&now).into())
    })
}

/// Freezes a tile (1) or unfreezes it (0): solves skip a frozen tile, so that it keeps its result, if it has one.
///
/// Errors: VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_freeze(tile: vrtm_tile, frozen: u32) -> vrtm_status {
    guard("vrtm_tile_freeze", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        let frozen = bool::from_c(frozen, "frozen")?;
        asset.write(|asset| Ok(asset.tile_mut(tile).freeze(frozen)?))
    })
}
