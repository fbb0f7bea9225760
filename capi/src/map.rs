//! The certificate of a redirection map.

use super::desc::{self, sized};
use super::fetch::{fetch_kind, vrtm_fetch_kind};
use super::guard::guard_struct;
use super::handle::{self, vrtm_tile};
use super::mirror::{Mirror, mirror};
use super::status::vrtm_status;
use super::types::vrtm_pixel_format;
use vrtm::{MapDesc, MapReport};
use vrtm_core::image::format::PixelFormat;

/// The kind, format and size of a redirection map to inspect. Start from vrtm_map_desc_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_map_desc {
    /// sizeof(vrtm_map_desc); set by vrtm_map_desc_init().
    pub struct_size: u32,
    /// VRTM_FETCH_REDIRECTION (0, the default), REDIRECTION_DELTA or REDIRECTION_UDIM.
    pub kind: vrtm_fetch_kind,
    /// VRTM_PIXEL_F32 (0, the default) or VRTM_PIXEL_F16.
    pub format: vrtm_pixel_format,
    /// Texels in u, 1 to 16384.
    pub width: u32,
    /// Texels in v, 1 to 16384.
    pub height: u32,
}

mirror! {
    report vrtm_map_info of r: MapReport {
        folds: u64, min_jacobian: f64, error_rms: f64, error_p99: f64, error_max: f64,
        /// Width at which the map has no folds: the given size, or the first that works of two and four times that
        /// size, then a half, a quarter and so on; 0 if no size was found. Larger maps often have more folds.
        sufficient_width: u32 = r.sufficient_size.unwrap_or_default()[0],
        /// Height at which the map has no folds; see `sufficient_width`.
        sufficient_height: u32 = r.sufficient_size.unwrap_or_default()[1],
    }
}

// SAFETY: repr(C), struct_size first, plain numbers.
sized!(vrtm_map_desc);

/// Inspects the map that a vrtm_asset_fetch of this kind, size and format would write for the last result. A map
/// samples the redirection at texel centres only, and a renderer's interpolation may fold where the warp squeezes.
/// This function reports whether it folds, how far it is from the exact redirection, and which size suffices. It takes
/// about as long as fetching the map and a second map of twice its size or the grid's. The map is computed on the CPU:
/// if a GPU writes it, single quads that almost fold may be counted differently.
///
/// Errors: VRTM_ERROR_NOT_SOLVED before the first solve; VRTM_ERROR_UNSUPPORTED for an integer format;
/// VRTM_ERROR_INVALID_ARGUMENT for a kind that is not a redirection. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_inspect_map(
    tile: vrtm_tile,
    desc: *const vrtm_map_desc,
    info: *mut vrtm_map_info,
) -> vrtm_status {
    guard_struct("vrtm_tile_inspect_map", info, "info", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        // SAFETY: the host's pointer.
        let desc = unsafe { desc::read(desc, "desc") }?;
        let (kind, format) =
            (fetch_kind(desc.kind, "desc.kind")?, PixelFormat::from_c(desc.format, "desc.format")?);
        let desc = MapDesc { kind, format, size: [desc.width, desc.height] };
        Ok(asset.results.tile(tile).inspect_map(&desc)?.into())
    })
}
