//! Assets and the look-up of their tiles.

use super::desc::{self, Out, Place, Sized32};
use super::guard::guard;
use super::handle::{self, vrtm_asset, vrtm_device, vrtm_tile};
use super::status::{Failure, Outcome, vrtm_status};
use super::types::{check_reserved, strided, vrtm_array};
use crate::asset::Asset;
use crate::error::{Error, ErrorKind};
use crate::mesh::{MeshSource, UvSource};

/// A mesh at rest. Start from vrtm_mesh_desc_init(). All arrays are copied before the call returns.
///
/// A face's corners stand one after the other: corner k of the mesh has the vertex indices[k] and the UV
/// uv_indices[k] (or UV k, without uv_indices). Polygons of any size will do; they are triangulated. UVs are
/// face-varying, v points up, and a face belongs to the UDIM tile 1001 + floor(u) + 10 floor(v) of its UV centroid.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_mesh_desc {
    /// sizeof(vrtm_mesh_desc); set by vrtm_mesh_desc_init().
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// Rest positions, 3 components, any unit of length. Required.
    pub positions: *const vrtm_array,
    /// Corners of each face, each at least 3; null = all faces are triangles.
    pub face_counts: *const u32,
    /// Number of faces: the length of `face_counts`. Ignored when that is null.
    pub face_count: usize,
    /// Vertex of each corner, less than positions->count. Required.
    pub indices: *const u32,
    /// Number of corners: the length of `indices`.
    pub index_count: usize,
    /// UVs as pairs (2 components). Give these, or both `u` and `v`.
    pub uvs: *const vrtm_array,
    /// u of each UV (1 component), where u and v are arrays of their own.
    pub u: *const vrtm_array,
    /// v of each UV (1 component), as many as `u`.
    pub v: *const vrtm_array,
    /// UV of each corner; null = one UV per corner, in the order of the corners.
    pub uv_indices: *const u32,
    /// The length of `uv_indices`: `index_count`. Ignored when that is null.
    pub uv_index_count: usize,
}

/// Description of a mesh. Start from vrtm_asset_data_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_asset_data {
    /// sizeof(vrtm_asset_data); set by vrtm_asset_data_init().
    pub struct_size: u32,
    /// Tiles with at least one triangle.
    pub tiles: u32,
    /// Vertices: the length of every array of positions.
    pub vertices: u64,
    /// Faces as given.
    pub faces: u64,
    /// Corners as given: the length of an array of corner UVs.
    pub corners: u64,
    /// Triangles kept, over all tiles.
    pub triangles: u64,
    /// Triangles dropped because their UVs have no area.
    pub degenerate_triangles: u64,
    /// Faces some of whose UVs lie outside of their tile; the map is clipped to the tile.
    pub clipped_faces: u64,
    /// Faces left out because their UV centroid lies in no UDIM tile (u < 0, u >= 10 or v < 0).
    pub faces_outside: u64,
    /// Charts, over all tiles.
    pub charts: u32,
    /// Zero.
    pub reserved: u32,
}

// SAFETY: repr(C), struct_size first, plain numbers and raw pointers.
unsafe impl Sized32 for vrtm_mesh_desc {
    const FIRST: usize = size_of::<vrtm_mesh_desc>();
    const NAME: &'static str = "vrtm_mesh_desc";
}

// SAFETY: as above.
unsafe impl Sized32 for vrtm_asset_data {
    const FIRST: usize = size_of::<vrtm_asset_data>();
    const NAME: &'static str = "vrtm_asset_data";
}

unsafe fn optional<'a>(pointer: *const u32, count: usize, name: &str) -> Outcome<Option<&'a [u32]>> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: the host vouches for `count` numbers.
    unsafe { desc::slice(pointer, count, name) }.map(Some)
}

unsafe fn mesh<'a>(desc: &vrtm_mesh_desc) -> Outcome<MeshSource<'a>> {
    check_reserved(desc.reserved, "desc")?;
    // SAFETY: all of these are the host's pointers, valid during the call.
    unsafe {
        let positions = strided(desc.positions, 3, "desc.positions")?;
        let face_counts = optional(desc.face_counts, desc.face_count, "desc.face_counts")?;
        let indices = desc::slice(desc.indices, desc.index_count, "desc.indices")?;
        let uv_indices = optional(desc.uv_indices, desc.uv_index_count, "desc.uv_indices")?;
        let uvs = match (desc.uvs.is_null(), desc.u.is_null() && desc.v.is_null()) {
            (false, true) => {
                let uvs = strided(desc.uvs, 2, "desc.uvs")?;
                UvSource { u: uvs, v: None, indices: uv_indices }
            }
            (true, false) => {
                let u = strided(desc.u, 1, "desc.u")?;
                let v = strided(desc.v, 1, "desc.v")?;
                UvSource { u, v: Some(v), indices: uv_indices }
            }
            (true, true) => {
                return Err(Failure::argument("desc.uvs is null, and so are desc.u and desc.v"));
            }
            (false, false) => {
                return Err(Failure::argument("desc.uvs is given, so desc.u and desc.v must be null"));
            }
        };
        Ok(MeshSource { positions, face_counts, indices, uvs })
    }
}

/// The core speaks of `uvs.u` and `uvs.indices`, which have other names here.
fn in_c_words(error: Error, pairs: bool) -> Error {
    if error.kind != ErrorKind::InvalidArgument {
        return error;
    }
    let message = error
        .message
        .replace("uvs.indices", "uv_indices")
        .replace("uvs.u", if pairs { "uvs" } else { "u" })
        .replace("uvs.v", "v");
    Error { message: format!("desc.{message}"), ..error }
}

/// Makes an asset from a mesh. `*asset` is the caller's to destroy; it may outlive `device`.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT, naming the array and the index, for null, an
/// index out of range, a value that is not finite, counts that do not add up or an empty mesh;
/// VRTM_ERROR_OUT_OF_MEMORY.
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
        let mesh = unsafe { mesh(&desc::read(desc, "desc")?) }?;
        let asset = Asset::new(&device, &mesh).map_err(|error| in_c_words(error, mesh.uvs.v.is_none()))?;
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
        let info = handle::asset(asset)?.info;
        out.write(vrtm_asset_data {
            struct_size: 0,
            tiles: info.tiles,
            vertices: info.vertices,
            faces: info.faces,
            corners: info.corners,
            triangles: info.triangles,
            degenerate_triangles: info.degenerate_triangles,
            clipped_faces: info.clipped_faces,
            faces_outside: info.faces_outside,
            charts: info.charts,
            reserved: 0,
        });
        Ok(())
    })
}

/// Ends an asset and all of its tile handles. If another thread is in a call on the asset, that call runs to its end
/// and the memory is freed then.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE, also when it was destroyed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_destroy(asset: vrtm_asset) -> vrtm_status {
    guard("vrtm_asset_destroy", || handle::remove_asset(asset))
}

/// Number of tiles that hold at least one triangle. Never busy.
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

/// The tile at `index`, 0 <= index < vrtm_asset_tile_count, in the order of the UDIM numbers. Never busy.
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

/// The tile with a UDIM number (1001 + U + 10 V).
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if the mesh has no triangle there or `tile` is
/// null; VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_find_tile(
    asset: vrtm_asset,
    udim: u32,
    tile: *mut vrtm_tile,
) -> vrtm_status {
    guard("vrtm_asset_find_tile", || {
        let out = Place::new(tile, "tile")?;
        let found = handle::asset(asset)?.read(|asset| Ok(asset.find_tile(udim)))?;
        let index = found.ok_or_else(|| Failure::argument(format!("udim: the asset has no tile {udim}")))?;
        out.write(handle::tile_handle(asset, index));
        Ok(())
    })
}
