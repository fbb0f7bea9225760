//! A tile's facts, maps and settings.

use super::desc::{self, Out, Place, Sized32};
use super::guard::guard;
use super::handle::{self, vrtm_asset, vrtm_tile};
use super::status::{Failure, Outcome, vrtm_status};
use super::types::{flag, image_or_none, strided, vrtm_array, vrtm_image};
use vrtm_core::settings::{OpenBorders, Overlap, Seams, TileSettings};

/// Facts of a tile that need no solve. Start from vrtm_tile_data_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_tile_data {
    /// sizeof(vrtm_tile_data); set by vrtm_tile_data_init().
    pub struct_size: u32,
    /// UDIM number: 1001 + U + 10 V.
    pub udim: u32,
    /// The UV set that the tile belongs to.
    pub uv_set: u32,
    /// Charts in the tile: connected pieces of UV triangles.
    pub charts: u32,
    /// Triangles in the tile.
    pub triangles: u64,
    /// Sides of triangles at which a chart ends.
    pub border_edges: u64,
    /// Edges inside charts whose two sides have different vertices: welded by position.
    pub welded_edges: u64,
    /// Edges whose two sides coincide but are not connected: see vrtm_asset_data.edges_apart.
    pub edges_apart: u64,
    /// Cells of the grid in u. A grid of w x h cells has (w + 1) x (h + 1) nodes.
    pub grid_width: u32,
    /// Cells of the grid in v.
    pub grid_height: u32,
    /// Nodes of the grid that may move.
    pub movable_nodes: u64,
    /// Fraction (0..1) of the covered nodes that more than one layer of triangles covers.
    pub overlap: f32,
    /// Fraction (0..1) of the rigid nodes that cannot move: of the covered nodes with a rigidity of at least 0.5, those
    /// that a border, an overlap or the mask fixes. Near 1, the rigidity map can have almost no effect.
    pub frozen: f32,
    /// Which layer of its UDIM number the tile is: 0 unless vrtm_mesh_desc.max_layers is over 1.
    pub layer: u32,
    /// Layers of its UDIM number: 1 or more.
    pub layers: u32,
    /// Rigid nodes: covered nodes with a rigidity of at least 0.5.
    pub rigid_nodes: u64,
    /// How many of these lie under more than one triangle, as those of charts in the same layer that lie over one
    /// another.
    pub rigid_overlapped: u64,
    /// Nodes inside charts that cannot move because of a gap in the UVs that welding closes, such as a slit narrower
    /// than vrtm_mesh_desc.weld_uv_tolerance. Noise of the UVs makes none.
    pub gap_nodes: u64,
}

/// Which chart moves texels that several charts of a tile share, or that a chart shares with itself. With
/// vrtm_mesh_desc.max_layers over 1, charts share texels only where these layers do not suffice.
pub type vrtm_overlap = i32;
/// Shared texels do not move, so that nothing gets worse; the default.
pub const VRTM_OVERLAP_FIXED: vrtm_overlap = 0;
/// The chart with the first face moves them: for mirrored halves that deform alike.
pub const VRTM_OVERLAP_FIRST_FACE: vrtm_overlap = 1;

/// What happens where the surface goes on beyond a chart's border, elsewhere in the UV plane.
pub type vrtm_seams = i32;
/// Nothing moves at a border, and any texture will do; the default.
pub const VRTM_SEAMS_SHUT: vrtm_seams = 0;
/// Each chart is solved together with what lies beyond its seams, laid out in its own plane up to `seam_reach`.
/// Redirections near a seam then lead over the border of the chart: the texture must show there what lies beyond it, as
/// vrtm_tile_fetch_dilation of at least the same reach says. Open borders, and charts that lie over one another in a
/// layer, stay as they are with VRTM_SEAMS_SHUT. Experimental.
pub const VRTM_SEAMS_CONTINUE: vrtm_seams = 1;
/// As VRTM_SEAMS_SHUT, but rigid features that touch a border of their chart (with VRTM_OPEN_BORDERS_SLIDE: a seam)
/// stay as they were, whole, and their elastic surroundings give way: never half of a feature. A feature is what hangs
/// together of nodes with a rigidity of at least 0.5. Any texture will do. Experimental.
pub const VRTM_SEAMS_KEEP: vrtm_seams = 2;

/// What happens at a border of a chart beyond which the surface ends: along an edge that only one face with texture
/// has.
pub type vrtm_open_borders = i32;
/// Nothing moves at an open border; the default. The surface may go on in a mesh that is not known here, as a head's
/// neck does.
pub const VRTM_OPEN_BORDERS_FIXED: vrtm_open_borders = 0;
/// Texture slides along open borders, as if the surface were mirrored there, so that a feature at a border keeps its
/// shape; any texture will do. Corners of more than 50 degrees stay where they are, and so do ends of a chart's seam
/// with itself. Edges whose vertices are not welded look like open borders, and so do those at which faces of other
/// sizes meet, or beyond which faces have no texture. Experimental.
pub const VRTM_OPEN_BORDERS_SLIDE: vrtm_open_borders = 1;

/// A tile's settings. Start from vrtm_tile_settings_init(), which sets the defaults.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_tile_settings {
    /// sizeof(vrtm_tile_settings); set by vrtm_tile_settings_init().
    pub struct_size: u32,
    /// Cells of the grid in u: the resolution of the solve. 0 = the rigidity map's width, or 1024 without a
    /// map. Rounded up to a multiple of 16, at most 16384. Five cells across the smallest rigid feature and three
    /// between two of them suffice.
    pub grid_width: u32,
    /// Cells of the grid in v, with the same rules as `grid_width`.
    pub grid_height: u32,
    /// VRTM_OVERLAP_FIXED (0, the default) or VRTM_OVERLAP_FIRST_FACE.
    pub overlap: vrtm_overlap,
    /// Smoothness of elastic material against the stiffness 1 of rigid material, 0 to 1e6; default 0.02. Lower values
    /// keep the shape of rigid features better, and make material of low rigidity more rigid.
    pub smoothness: f32,
    /// Smoothness of all material, 1e-6 to 1e6; default 0.0005.
    pub smoothness_floor: f32,
    /// Weight that keeps rigid features from turning, 0 (the default) to 1e6.
    pub orientation: f32,
    /// Addition to `orientation` where rigid features are dense, times that density (the mean rigidity, 0..1, over a
    /// tent of half of the tile), 0 (the default) to 1e6. Sparse features then turn to keep their shape, and dense ones
    /// keep their orientation. VRTM_SOLVER_PBD adds it to the fraction of its turn that a segment takes back.
    pub orientation_density: f32,
    /// Weight of the penalty on cells that lose their area, 0 to 1e6; default 0.3.
    pub room: f32,
    /// Fraction of a cell's area, 0 to 1, under which that penalty starts; default 0.4.
    pub room_threshold: f32,
    /// VRTM_SEAMS_SHUT (0, the default), VRTM_SEAMS_KEEP, or VRTM_SEAMS_CONTINUE; the latter only with an
    /// `orientation_density` of 0.
    pub seams: vrtm_seams,
    /// How far charts go on beyond their seams with VRTM_SEAMS_CONTINUE, and beyond their open borders with
    /// VRTM_OPEN_BORDERS_SLIDE, in UV: about the size of a large rigid feature. At most 0.5; 0 (the default) = 0.03125.
    pub seam_reach: f32,
    /// VRTM_OPEN_BORDERS_FIXED (0, the default) or VRTM_OPEN_BORDERS_SLIDE; the latter only with an
    /// `orientation_density` of 0.
    pub open_borders: vrtm_open_borders,
    /// How far rigid features that the pose does not strain come before those that it strains, 0 (the default) to 1. At
    /// 0 each gives way alike, and in a crowd a feature may come out worse than without the warp; the higher this is,
    /// the fewer do, and the others keep a little more strain. For VRTM_SOLVER_DESCENT. Experimental.
    pub protect: f32,
}

// SAFETY: repr(C), struct_size first, plain numbers.
unsafe impl Sized32 for vrtm_tile_data {
    // It ended with `frozen`.
    const FIRST: usize = 72;
    const NAME: &'static str = "vrtm_tile_data";
}

// SAFETY: as above.
unsafe impl Sized32 for vrtm_tile_settings {
    // It ended with `room_threshold`.
    const FIRST: usize = 40;
    const NAME: &'static str = "vrtm_tile_settings";
}

impl Default for vrtm_tile_settings {
    fn default() -> vrtm_tile_settings {
        vrtm_tile_settings {
            struct_size: size_of::<vrtm_tile_settings>() as u32,
            seam_reach: 0.0,
            ..to_c(&TileSettings::default())
        }
    }
}

/// The settings as the C struct, without its size.
fn to_c(settings: &TileSettings) -> vrtm_tile_settings {
    vrtm_tile_settings {
        struct_size: 0,
        grid_width: settings.grid[0].unwrap_or(0),
        grid_height: settings.grid[1].unwrap_or(0),
        overlap: match settings.overlap {
            Overlap::Fixed => VRTM_OVERLAP_FIXED,
            Overlap::FirstFace => VRTM_OVERLAP_FIRST_FACE,
        },
        smoothness: settings.smoothness,
        smoothness_floor: settings.smoothness_floor,
        orientation: settings.orientation,
        orientation_density: settings.orientation_density,
        room: settings.room,
        room_threshold: settings.room_threshold,
        seams: match settings.seams {
            Seams::Shut => VRTM_SEAMS_SHUT,
            Seams::Continue => VRTM_SEAMS_CONTINUE,
            Seams::Keep => VRTM_SEAMS_KEEP,
        },
        seam_reach: settings.seam_reach,
        open_borders: match settings.open_borders {
            OpenBorders::Fixed => VRTM_OPEN_BORDERS_FIXED,
            OpenBorders::Slide => VRTM_OPEN_BORDERS_SLIDE,
        },
        protect: settings.protect,
    }
}

fn settings(from: &vrtm_tile_settings) -> Outcome<TileSettings> {
    let overlap = match from.overlap {
        VRTM_OVERLAP_FIXED => Overlap::Fixed,
        VRTM_OVERLAP_FIRST_FACE => Overlap::FirstFace,
        other => {
            return Err(Failure::argument(format!("settings.overlap is {other}, no VRTM_OVERLAP_ value")));
        }
    };
    let seams = match from.seams {
        VRTM_SEAMS_SHUT => Seams::Shut,
        VRTM_SEAMS_CONTINUE => Seams::Continue,
        VRTM_SEAMS_KEEP => Seams::Keep,
        other => return Err(Failure::argument(format!("settings.seams is {other}, no VRTM_SEAMS_ value"))),
    };
    let open_borders = match from.open_borders {
        VRTM_OPEN_BORDERS_FIXED => OpenBorders::Fixed,
        VRTM_OPEN_BORDERS_SLIDE => OpenBorders::Slide,
        other => {
            let message = format!("settings.open_borders is {other}, no VRTM_OPEN_BORDERS_ value");
            return Err(Failure::argument(message));
        }
    };
    Ok(TileSettings {
        grid: [from.grid_width, from.grid_height].map(|n| (n != 0).then_some(n)),
        smoothness: from.smoothness,
        smoothness_floor: from.smoothness_floor,
        orientation: from.orientation,
        orientation_density: from.orientation_density,
        room: from.room,
        room_threshold: from.room_threshold,
        overlap,
        seams,
        seam_reach: if from.seam_reach == 0.0 { TileSettings::default().seam_reach } else { from.seam_reach },
        open_borders,
        protect: from.protect,
    })
}

/// UDIM number (1001 + U + 10 V) and UV set of a tile. `uv_set` may be null. Unlike vrtm_tile_info, it does not prepare
/// the tile. Never busy.
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

/// Which layer of its UDIM number a tile is, and how many layers there are: 0 and 1 unless vrtm_mesh_desc.max_layers is
/// over 1. `layers` may be null. Layers share their maps and settings: what is set for one of them holds for all.
/// Unlike vrtm_tile_info, it does not prepare the tile. Never busy.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `layer` is null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_layer(tile: vrtm_tile, layer: *mut u32, layers: *mut u32) -> vrtm_status {
    guard("vrtm_tile_layer", || {
        let layer_out = Place::new(layer, "layer")?;
        let (asset, tile) = handle::tile("tile", tile)?;
        let (layer, count) = asset.results.tile_layer(tile);
        layer_out.write(layer);
        if !layers.is_null() {
            Place::new(layers, "layers")?.write(count);
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
            layer: info.layer,
            layers: info.layers,
            rigid_nodes: info.rigid_nodes,
            rigid_overlapped: info.rigid_overlapped,
            gap_nodes: info.gap_nodes,
        });
        Ok(())
    })
}

/// Sets a tile's rigidity, for all of its layers: 0 is infinitely elastic, 1 as rigid as possible; values outside are
/// clamped. The map may have any size; it is resampled to the grid. Null removes the map. A tile without one has the
/// rigidity of the vertices (vrtm_asset_set_vertex_rigidity), and without that, too, does not move at all. The last
/// result stays readable until the next solve. May be called between frames; only data that depends on the map is
/// rebuilt.
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

/// Updates a part of a tile's rigidity map, for instance after a brush stroke: `width` x `height` texels from the
/// column `x` and the row `y`, in memory order. `rigidity` describes the whole map, with the size and the format of the
/// one that was set; its other texels are not read. Updating a small part takes a small fraction of the time of setting
/// the map, unless a chart gains its first rigidity or loses its last, or orientation_density is in use: then the tile
/// is prepared again.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if the tile has no map of this size and format, if
/// the part is empty or not inside the map, and in the cases of vrtm_tile_set_rigidity; VRTM_ERROR_BUSY;
/// VRTM_ERROR_OUT_OF_MEMORY.
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

/// Sets a tile's warp mask: points under a texel below 0.5 do not move. Null removes it. A tile without one has the
/// mask of the vertices (vrtm_asset_set_vertex_mask), and without that, too, all may move: the default. In other
/// respects as vrtm_tile_set_rigidity.
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

/// Sets the rigidity of the vertices (1 component, as many as vertices, 0..1), linear over each triangle. A tile with
/// a map (vrtm_tile_set_rigidity) has that of its map, in whatever order the two are set. Null removes the values and
/// leaves the maps. Without a map, a tile's grid has the size in its settings, or 1024 x 1024.
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
        let values = if mask.is_null() {
            None
        } else {
            // SAFETY: the host's pointer, valid during the call.
            Some(unsafe { strided(mask, 1, "mask") }?)
        };
        asset.write(|asset| Ok(asset.set_vertex_mask(values)?))
    })
}

/// Sets a tile's settings, for all of its layers. Null: all defaults.
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

/// Gets a tile's settings, as set or the defaults. The struct can be passed to vrtm_tile_set_settings unchanged.
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
        out.write(to_c(&now));
        Ok(())
    })
}

/// Freezes a tile (1) or unfreezes it (0): solves skip a frozen tile, so that it keeps its result, if it has one.
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
