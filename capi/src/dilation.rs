//! What textures must hold around charts.

use super::guard::guard;
use super::handle::{self, vrtm_tile};
use super::status::vrtm_status;
use super::types::{Target, vrtm_image_out};
use vrtm::FetchKind;

/// Writes what a texture must hold around a tile's charts, so that a lookup beside a seam shows what the surface shows
/// there: for each texel whose centre lies beside the charts, up to about `reach` from a seam, the UV of the texel to
/// copy from, in the mesh's own range as with VRTM_FETCH_REDIRECTION_UDIM; for all other texels their own centre.
/// `reach` is a length in UV, over 0 and at most 0.5. Two to four channels: u, v, 0, and 1 in charts and where a UV was
/// found, 0 elsewhere. Use f32. It depends on the rest positions and the UVs alone: no solve is needed, and once per
/// mesh and size is enough. Triangles that would come out mirrored, or with less than a quarter or more than four times
/// the chart's area at its border, are left out.
///
/// Errors: VRTM_ERROR_UNSUPPORTED for an integer format. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_fetch_dilation(
    tile: vrtm_tile,
    reach: f64,
    image: *const vrtm_image_out,
) -> vrtm_status {
    guard("vrtm_tile_fetch_dilation", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        // SAFETY: the host's pointer, valid during the call.
        let target = unsafe { Target::read(image, "image", FetchKind::RedirectionUdim) }?;
        // SAFETY: the host vouches for the memory, and this is the only view of it.
        let mut view = unsafe { target.view("image") }?;
        Ok(asset.results.tile(tile).fetch_dilation(reach, &mut view)?)
    })
}
