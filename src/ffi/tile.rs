//! A tile's facts, maps and settings.

use std::mem::offset_of;

use super::desc::{self, Out, Place, Sized32};
use super::guard::guard;
use super::handle::{self, vrtm_asset, vrtm_tile};
use super::status::{Failure, Outcome, vrtm_status};
use super::types::{check_reserved, flag, image_or_none, strided, vrtm_array, vrtm_image};
use crate::settings::{Overlap, TileSettings};

/// Facts of a tile that need no solve. Start from vrtm_tile_data_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_tile_data {
    /// sizeof(vrtm_tile_data); set by vrtm_tile_data_init().
    pub struct_size: u32,
    /// UDIM number: 1001 + U + 10 V.
    pub udim: u32,
    /// Triangles in the tile.
    pub triangles: u64,
    /// Nodes of the grid that may move.
    pub movable_nodes: u64,
    /// Charts in the tile: connected pieces of UV triangles.
    pub charts: u32,
    /// Cells of the grid in u. A grid of w x h cells has (w + 1) x (h + 1) nodes.
    pub grid_width: u32,
    /// Cells of the grid in v.
    pub grid_height: u32,
    /// Fraction (0..1) of the covered nodes that more than one layer of triangles covers.
    pub overlap: f32,
    /// Sides of triangles at which a chart ends.
    pub border_edges: u64,
    /// Edges inside charts whose two sides have different vertices: welded by position.
    pub welded_edges: u64,
    /// Edges whose two sides lie together and are not connected: see vrtm_asset_data.
    pub edges_apart: u64,
    /// The UV set that it belongs to.
    pub uv_set: u32,
    /// Fraction (0..1) of the rigid texels that do not move: of the nodes under a triangle with a rigidity of at least
    /// 0.5, those that a border, an overlap or the mask fixes. Near 1, a map can have no effect.
    pub frozen: f32,
}

/// Who owns texels that faces of different charts, or two layers of one chart, share.
pub type vrtm_overlap = i32;
/// They do not move, so that nothing gets worse; the default.
pub const VRTM_OVERLAP_FIXED: vrtm_overlap = 0;
/// The chart with the first face owns them: for mirrored halves that deform alike.
pub const VRTM_OVERLAP_FIRST_FACE: vrtm_overlap = 1;

/// For a setting whose zero means "the default": no such term at all.
pub const VRTM_OFF: f32 = -1.0;

/// A tile's settings; zero in a field means its default. Start from vrtm_tile_settings_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_tile_settings {
    /// sizeof(vrtm_tile_settings); set by vrtm_tile_settings_init().
    pub struct_size: u32,
    /// VRTM_OVERLAP_FIXED (0, the default) or VRTM_OVERLAP_FIRST_FACE.
    pub overlap: vrtm_overlap,
    /// Cells of the grid in u: the resolution of the solve. 0 = the rigidity map's width, or 1024 without a
    /// map. Rounded up to a multiple of 16, at most 16384.
    pub grid_width: u32,
    /// Cells of the grid in v, likewise.
    pub grid_height: u32,
    /// Smoothness of elastic material against the stiffness 1 of rigid material, up to 1e6; 0 = 0.02, VRTM_OFF = none.
    /// A lower one lets rigid features keep their shape better and makes material of little rigidity more rigid.
    pub smoothness: f32,
    /// Smoothness of all material, 1e-6 to 1e6; 0 = 0.0005.
    pub smoothness_floor: f32,
    /// Weight that keeps rigid features from turning, up to 1e6; 0 = none, the default.
    pub orientation: f32,
    /// Weight of the penalty on cells that lose their area, up to 1e6; 0 = 0.3, VRTM_OFF = none.
    pub room: f32,
    /// Fraction of a cell's area, up to 1, under which that penalty starts; 0 = 0.4, VRTM_OFF = 0.
    pub room_threshold: f32,
    /// Zero.
    pub reserved: u32,
    /// Addition to `orientation` where rigid features are dense, times that density (the mean rigidity, 0..1, over
    /// a tent of half of the tile), up to 1e6; 0 = none, the default. Sparse features then turn to keep their shape,
    /// dense ones stay in order. For VRTM_SOLVER_PBD it is added to the fraction that a segment turns back.
    pub orientation_density: f32,
}

// SAFETY: repr(C), struct_size first, plain numbers.
unsafe impl Sized32 for vrtm_tile_data {
    const FIRST: usize = offset_of!(vrtm_tile_data, border_edges);
    const NAME: &'static str = "vrtm_tile_data";
}

// SAFETY: as above.
unsafe impl Sized32 for vrtm_tile_settings {
    const FIRST: usize = offset_of!(vrtm_tile_settings, orientation_density);
    const NAME: &'static str = "vrtm_tile_settings";
}

/// A field of the settings: zero is the default, VRTM_OFF is zero. Other numbers are checked with the settings, which
/// know nothing of VRTM_OFF.
fn or_default(name: &str, value: f32, default: f32) -> Outcome<f32> {
    match value {
        0.0 => Ok(default),
        VRTM_OFF => Ok(0.0),
        _ if value < 0.0 => {
            let message = format!("settings.{name}: {value} is negative, and not VRTM_OFF (-1) either");
            Err(Failure::argument(message))
        }
        _ => Ok(value),
    }
}

/// The inverse of [`or_default`] for values in use.
fn or_off(value: f32) -> f32 {
    if value == 0.0 { VRTM_OFF } else { value }
}

fn settings(from: &vrtm_tile_settings) -> Outcome<TileSettings> {
    check_reserved(from.reserved, "settings")?;
    let overlap = match from.overlap {
        VRTM_OVERLAP_FIXED => Overlap::Fixed,
        VRTM_OVERLAP_FIRST_FACE => Overlap::FirstFace,
        other => {
            return Err(Failure::argument(format!("settings.overlap is {other}, no VRTM_OVERLAP_ value")));
        }
    };
    let default = TileSettings::default();
    Ok(TileSettings {
        grid: [from.grid_width, from.grid_height].map(|n| (n != 0).then_some(n)),
        smoothness: or_default("smoothness", from.smoothness, default.smoothness)?,
        // It has no "off": without it a node may have no say in where it goes.
        smoothness_floor: if from.smoothness_floor == 0.0 {
            default.smoothness_floor
        } else {
            from.smoothness_floor
        },
        orientation: from.orientation,
        orientation_density: from.orientation_density,
        room: or_default("room", from.room, default.room)?,
        room_threshold: or_default("room_threshold", from.room_threshold, default.room_threshold)?,
        overlap,
    })
}

/// UDIM number (1001 + U + 10 V) and UV set of a tile. `uv_set` may be null. Unlike vrtm_tile_info it prepares
/// nothing. Never busy.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `udim` is null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_udim(tile: vrtm_tile, udim: *mut u32, uv_set: *mut u32) -> vrtm_status {
    guard("vrtm_tile_udim", || {
        let udim_out = Place::new(udim, "udim")?;
        let (asset, tile) = handle::tile("tile", tile)?;
        let (udim, set) = asset.results.tile_udim(tile);
        udim_out.write(udim);
        if !uv_set.is_null() {
            Place::new(uv_set, "uv_set")?.write(set);
        }
        Ok(())
    })
}

/// Describes a tile. The first call, and the first after a change of map or settings, builds the tile's
/// grid, which takes time.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `info` is null or has a wrong struct_size;
/// VRTM_ERROR_BUSY; VRTM_ERROR_OUT_OF_MEMORY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_info(tile: vrtm_tile, info: *mut vrtm_tile_data) -> vrtm_status {
    guard("vrtm_tile_info", || {
        let out = Out::new(info, "info")?;
        let (asset, tile) = handle::tile("tile", tile)?;
        let info = asset.write(|asset| Ok(asset.tile_info(tile)?))?;
        out.write(vrtm_tile_data {
            struct_size: 0,
            udim: info.udim,
            triangles: info.triangles,
            movable_nodes: info.movable_nodes,
            charts: info.charts,
            grid_width: info.grid[0],
            grid_height: info.grid[1],
            overlap: info.overlap,
            border_edges: info.border_edges,
            welded_edges: info.welded_edges,
            edges_apart: info.edges_apart,
            uv_set: info.uv_set,
            frozen: info.frozen,
        });
        Ok(())
    })
}

/// Sets a tile's rigidity: 0 is infinitely elastic, 1 as rigid as possible; values outside are clamped. Any size; it is
/// resampled to the grid. Null takes the map away: a tile without rigidity does not move at all. The last result stays
/// readable until the next solve. May be called between frames; only what depends on it is rebuilt.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT, naming the field or the texel, for null data, a
/// zero size, a short stride or a value that is not finite; VRTM_ERROR_BUSY; VRTM_ERROR_OUT_OF_MEMORY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_set_rigidity(tile: vrtm_tile, rigidity: *const vrtm_image) -> vrtm_status {
    guard("vrtm_tile_set_rigidity", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        // SAFETY: the host's pointer, valid during the call.
        let image = unsafe { image_or_none(rigidity, "rigidity") }?;
        asset.write(|asset| Ok(asset.set_rigidity(tile, image)?))
    })
}

/// Takes a part of a tile's rigidity map anew, after a stroke of a brush for instance: `width` x `height` texels from
/// the column `x` and the row `y`, as they lie in memory. `rigidity` describes the whole map, with the size and the
/// format of the one that was set; its other texels are not read. A small part takes a small fraction of the time that
/// setting the map takes, unless a chart gets its first rigidity or loses its last, or orientation_density is in use:
/// then the tile is prepared anew.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if there is no map of this size and format, if the
/// part is empty or not inside of it, and as vrtm_tile_set_rigidity; VRTM_ERROR_BUSY; VRTM_ERROR_OUT_OF_MEMORY.
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
        asset.write(|asset| Ok(asset.update_rigidity(tile, image, [x, y], [width, height])?))
    })
}

/// Sets a tile's warp mask: what lies under a texel of less than 0.5 does not move. Null: all may move, the default.
/// Otherwise as vrtm_tile_set_rigidity.
///
/// Errors: those of vrtm_tile_set_rigidity.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_set_mask(tile: vrtm_tile, mask: *const vrtm_image) -> vrtm_status {
    guard("vrtm_tile_set_mask", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        // SAFETY: the host's pointer, valid during the call.
        let image = unsafe { image_or_none(mask, "mask") }?;
        asset.write(|asset| Ok(asset.set_mask(tile, image)?))
    })
}

/// Sets the rigidity of all tiles from one value per vertex (1 component, as many as vertices, 0..1), linear over each
/// triangle. Null takes it away. A tile's grid then has the size in its settings, or 1024 x 1024.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT for null data, a wrong count, a short stride or a
/// value that is not finite; VRTM_ERROR_BUSY; VRTM_ERROR_OUT_OF_MEMORY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_set_vertex_rigidity(
    asset: vrtm_asset,
    rigidity: *const vrtm_array,
) -> vrtm_status {
    guard("vrtm_asset_set_vertex_rigidity", || {
        let asset = handle::asset(asset)?;
        let values = if rigidity.is_null() {
            None
        } else {
            // SAFETY: the host's pointer, valid during the call.
            Some(unsafe { strided(rigidity, 1, "rigidity") }?)
        };
        asset.write(|asset| Ok(asset.set_vertex_rigidity(values)?))
    })
}

/// Sets the warp mask of all tiles from one value per vertex (1 component, as many as vertices), linear over each
/// triangle: what is under 0.5 does not move. Null: all may move, the default.
///
/// Errors: those of vrtm_asset_set_vertex_rigidity.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_set_vertex_mask(
    asset: vrtm_asset,
    mask: *const vrtm_array,
) -> vrtm_status {
    guard("vrtm_asset_set_vertex_mask", || {
        let asset = handle::asset(asset)?;
        let values = if mask.is_null() {
            None
        } else {
            // SAFETY: the host's pointer, valid during the call.
            Some(unsafe { strided(mask, 1, "mask") }?)
        };
        asset.write(|asset| Ok(asset.set_vertex_mask(values)?))
    })
}

/// Sets a tile's settings. Null: all defaults.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT, naming the field; VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_set_settings(
    tile: vrtm_tile,
    settings: *const vrtm_tile_settings,
) -> vrtm_status {
    guard("vrtm_tile_set_settings", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        // SAFETY: the host's pointer, valid during the call.
        let new = self::settings(&unsafe { desc::read_or_default(settings, "settings") }?)?;
        asset.write(|asset| Ok(asset.set_settings(tile, &new)?))
    })
}

/// A tile's settings with the defaults filled in (a grid of 0 x 0 still means the rigidity map's size). What comes out
/// can be passed to vrtm_tile_set_settings as it is.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `settings` is null or has a wrong struct_size;
/// VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_get_settings(
    tile: vrtm_tile,
    settings: *mut vrtm_tile_settings,
) -> vrtm_status {
    guard("vrtm_tile_get_settings", || {
        let out = Out::new(settings, "settings")?;
        let (asset, tile) = handle::tile("tile", tile)?;
        let now = asset.read(|asset| Ok(asset.settings(tile)?))?;
        out.write(vrtm_tile_settings {
            struct_size: 0,
            overlap: match now.overlap {
                Overlap::Fixed => VRTM_OVERLAP_FIXED,
                Overlap::FirstFace => VRTM_OVERLAP_FIRST_FACE,
            },
            grid_width: now.grid[0].unwrap_or(0),
            grid_height: now.grid[1].unwrap_or(0),
            smoothness: or_off(now.smoothness),
            smoothness_floor: now.smoothness_floor,
            orientation: now.orientation,
            room: or_off(now.room),
            room_threshold: or_off(now.room_threshold),
            reserved: 0,
            orientation_density: now.orientation_density,
        });
        Ok(())
    })
}

/// Freezes a tile (1) or lets it go (0): solves leave a frozen tile alone, so that it keeps its result, or stays without
/// one.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `frozen` is neither 0 nor 1; VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_freeze(tile: vrtm_tile, frozen: u32) -> vrtm_status {
    guard("vrtm_tile_freeze", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        let frozen = flag(frozen, "frozen")?;
        asset.write(|asset| Ok(asset.freeze(tile, frozen)?))
    })
}
