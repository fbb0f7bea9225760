//! Reading results into the host's memory.

use std::ops::Range;
use std::sync::Arc;

use super::carrier::{CARRIERS, Points};
use super::desc::{self, sized};
use super::guard::guard;
use super::handle::{self, vrtm_asset, vrtm_carrier, vrtm_tile};
use super::status::{Failure, Outcome, vrtm_status};
use super::strips::{Strips, check_apart};
use super::types::{Target, vrtm_carried, vrtm_image_out};
use vrtm::{Carrier, Fetch, FetchKind, Results};
use vrtm_core::allocation::Vec;

/// Content of a fetched image: two channels (u, v) per texel, 2 * width * height values, unless stated otherwise.
pub type vrtm_fetch_kind = i32;
/// The redirection map, the default: for a surface point's UV, the UV at which to sample the texture. Absolute within
/// the tile (0..1, v up), at texel centres: where nothing moves, texel (x, y) from the corner (0, 0) holds ((x + 0.5) /
/// width, (y + 0.5) / height). Use f32: from 1024 texels on, f16 cannot distinguish neighbouring texels.
pub const VRTM_FETCH_REDIRECTION: vrtm_fetch_kind = 0;
/// The redirection minus the texel's own centre: the offset to add to a UV; 0 where nothing moves. f16 is sufficient.
pub const VRTM_FETCH_REDIRECTION_DELTA: vrtm_fetch_kind = 1;
/// The warp, the inverse of the redirection: for a UV of the texture, the UV of the surface point that shows it,
/// absolute within the tile (nodes of VRTM_SOLVER_PBD may lie a little outside of it). The outermost texels lie on the
/// tile's border; with the grid's size plus one in both directions the texels are the grid's nodes. Between the nodes
/// the warp is affine on two triangles per cell, split from the corner of least u and v to the corner of greatest. Use
/// f32.
pub const VRTM_FETCH_WARP: vrtm_fetch_kind = 2;
/// The redirection plus the offset (U, V) of the UDIM tile: UVs in the mesh's own range, for lookups in a texture of
/// several tiles. Use f32.
pub const VRTM_FETCH_REDIRECTION_UDIM: vrtm_fetch_kind = 3;
/// Four channels, 4 * width * height values: derivatives of the redirection (u', v') by the UV at texel centres,
/// du'/du, du'/dv, dv'/du, dv'/dv; 1, 0, 0, 1 where nothing moves. Use them to rotate texture values that turn with a
/// feature, such as tangent-space normals. f16 is sufficient.
pub const VRTM_FETCH_JACOBIAN: vrtm_fetch_kind = 4;
/// One channel, width * height values: the largest singular value of the Jacobian. The footprint of a lookup is at
/// most this factor wider in the texture than on the surface: for renderers that derive their filter width from the
/// mesh's own UVs. f16 is sufficient.
pub const VRTM_FETCH_FILTER_SCALE: vrtm_fetch_kind = 5;
/// UVs of another UV set, vrtm_fetch.uv_set, for meshes whose textures use another set than the warp is solved in:
/// where the redirection leads to a point of the surface, the UV of that point in the other set, whatever its range.
/// The map is looked up by the UVs of the tile's own set. 0 beside charts, but for a margin of two texels. Where the
/// other set has a border inside a chart, look the map up without interpolation, or use the delta. Use f32. With 4
/// channels, the fourth is 1 where a chart covers the texel's centre.
pub const VRTM_FETCH_UV_SET: vrtm_fetch_kind = 6;
/// As VRTM_FETCH_UV_SET, minus the UV in that set of the texel's own point of the surface: the offset to add to the UV
/// that the textures use; 0 where nothing moves. f16 is sufficient. Works with textures that repeat.
pub const VRTM_FETCH_UV_SET_DELTA: vrtm_fetch_kind = 7;
/// No image: the points of `carrier` in the pose, written to `carried` as by vrtm_carrier_fetch.
pub const VRTM_FETCH_CARRIED: vrtm_fetch_kind = 8;

/// One output of a solve. Start from vrtm_fetch_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_fetch {
    /// sizeof(vrtm_fetch); set by vrtm_fetch_init(). All elements of an array must have the same value.
    pub struct_size: u32,
    /// One of VRTM_FETCH_: REDIRECTION (0, the default), REDIRECTION_DELTA, WARP, REDIRECTION_UDIM, JACOBIAN,
    /// FILTER_SCALE, UV_SET, UV_SET_DELTA, CARRIED. With CARRIED, all fields but `carrier` and `carried` are 0.
    pub kind: vrtm_fetch_kind,
    /// A tile of the asset. Required.
    pub tile: vrtm_tile,
    /// The destination, of as many channels as `kind` has. Required.
    pub image: *const vrtm_image_out,
    /// For VRTM_FETCH_UV_SET and VRTM_FETCH_UV_SET_DELTA: the UV set that the values are UVs of, 0 <= uv_set <
    /// vrtm_asset_info.uv_sets. 0 (the default) for all other kinds.
    pub uv_set: u32,
    /// Texels in u of the whole image, if `image` is a rectangle of a larger one, such as a band of one that does not
    /// fit into memory. On the CPU, rectangles equal those of the whole image bit for bit. 0 (the default) = `image` is
    /// the whole, as it must be for VRTM_FETCH_UV_SET and VRTM_FETCH_UV_SET_DELTA.
    pub whole_width: u32,
    /// Texels in v of the whole image; 0 exactly if `whole_width` is.
    pub whole_height: u32,
    /// First column of the rectangle in the whole image.
    pub x: u32,
    /// First row of the rectangle in the whole image, counted in the order of image->origin.
    pub y: u32,
    /// Must be 0.
    pub reserved: u32,
    /// For VRTM_FETCH_CARRIED: a carrier of the asset.
    pub carrier: vrtm_carrier,
    /// For VRTM_FETCH_CARRIED: the destinations of its points.
    pub carried: *const vrtm_carried,
}

// SAFETY: repr(C), struct_size first, plain numbers and a raw pointer.
sized!(vrtm_fetch);

pub(super) fn fetch_kind(kind: vrtm_fetch_kind, name: &str) -> Outcome<FetchKind> {
    match kind {
        VRTM_FETCH_REDIRECTION => Ok(FetchKind::Redirection),
        VRTM_FETCH_REDIRECTION_DELTA => Ok(FetchKind::RedirectionDelta),
        VRTM_FETCH_WARP => Ok(FetchKind::Warp),
        VRTM_FETCH_REDIRECTION_UDIM => Ok(FetchKind::RedirectionUdim),
        VRTM_FETCH_JACOBIAN => Ok(FetchKind::Jacobian),
        VRTM_FETCH_FILTER_SCALE => Ok(FetchKind::FilterScale),
        VRTM_FETCH_UV_SET | VRTM_FETCH_UV_SET_DELTA | VRTM_FETCH_CARRIED => {
            Err(Failure::argument(format!("{name} is {kind}, which is for vrtm_fetch only")))
        }
        other => Err(Failure::argument(format!("{name} is {other}, no VRTM_FETCH_ value"))),
    }
}

impl vrtm_fetch {
    /// The fetch `name`, checked, and the results that it is of.
    unsafe fn checked<'a>(&self, name: &str) -> Outcome<(Checked<'a>, Results)> {
        if self.reserved != 0 {
            return Err(Failure::unsupported(format!("{name}.reserved is {}", self.reserved)));
        }
        if self.kind == VRTM_FETCH_CARRIED {
            // SAFETY: the host's pointer.
            return unsafe { self.checked_points(name) };
        }
        let (asset, tile) = handle::tile(&format!("{name}.tile"), self.tile)?;
        ensure!(
            self.carrier.id == 0 && self.carried.is_null(),
            "{name}.carrier and carried are given, but the kind is not CARRIED"
        );
        let (set, sets) = (self.uv_set, asset.info.uv_sets);
        let is_of_set = matches!(self.kind, VRTM_FETCH_UV_SET | VRTM_FETCH_UV_SET_DELTA);
        ensure!(!is_of_set || set < sets, "{name}.uv_set is {set}, but the mesh has {sets} UV sets");
        ensure!(is_of_set || set == 0, "{name}.uv_set is {set}, but the kind is not of a UV set");
        let kind = match self.kind {
            VRTM_FETCH_UV_SET => FetchKind::UvSet(set),
            VRTM_FETCH_UV_SET_DELTA => FetchKind::UvSetDelta(set),
            kind => fetch_kind(kind, &format!("{name}.kind"))?,
        };
        let name_of_image = format!("{name}.image");
        // SAFETY: the host's pointer.
        let target = unsafe { Target::read(self.image, &name_of_image, kind) }?;
        let (size, [x, y]) = ([self.whole_width, self.whole_height], [self.x, self.y]);
        ensure!(
            size != [0, 0] || [x, y] == [0, 0],
            "{name}.x and y are {x} and {y}, but whole_width and whole_height are 0"
        );
        let whole = (size != [0, 0]).then_some((size, [x, y]));
        Ok((Checked::Image { name: name_of_image, tile, kind, target, whole }, asset.results.clone()))
    }

    /// The fetch `name` of carried points, checked.
    unsafe fn checked_points<'a>(&self, name: &str) -> Outcome<(Checked<'a>, Results)> {
        let carrier = CARRIERS.get(&format!("{name}.carrier"), self.carrier.id)?;
        let of_image = [self.uv_set, self.whole_width, self.whole_height, self.x, self.y];
        ensure!(
            self.tile.id == 0 && self.image.is_null() && of_image == [0; 5],
            "{name}: fields of images are given, but the kind is CARRIED"
        );
        // SAFETY: the host's pointer.
        let points =
            unsafe { Points::read(self.carried, &format!("{name}.carried"), carrier.states().len()) }?;
        let results = carrier.results().clone();
        Ok((Checked::Carried { carrier, points }, results))
    }
}

/// A checked fetch.
enum Checked<'a> {
    Image {
        /// The image's name, for messages.
        name: String,
        /// The tile's index.
        tile: usize,
        kind: FetchKind,
        target: Target,
        /// The size of the whole image, and the place of this one in it.
        whole: Option<([u32; 2], [u32; 2])>,
    },
    Carried {
        carrier: Arc<Carrier>,
        points: Points<'a>,
    },
}

/// A host's array of fetches, checked.
pub(super) struct Wanted<'a> {
    all: Vec<Checked<'a>>,
    /// The results that they are of; `None` for no fetches.
    pub results: Option<Results>,
}

impl<'a> Wanted<'a> {
    /// Reads an array of fetches, of `results` if they are given. No two outputs may write the same byte, and none may
    /// overlap `input`.
    pub unsafe fn read(
        mut results: Option<Results>,
        fetches: *const vrtm_fetch,
        count: usize,
        input: Range<usize>,
    ) -> Outcome<Wanted<'a>> {
        let mut all = Vec::new();
        if count > 0 {
            // SAFETY: the host vouches for `count` structs, spaced by the first one's struct_size.
            let stride = unsafe { desc::read(fetches, "fetches") }?.struct_size;
            for index in 0..count {
                let name = format!("fetches[{index}]");
                let at = index.checked_mul(stride as usize).and_then(|n| fetches.addr().checked_add(n));
                let at = at.ok_or_else(|| {
                    Failure::argument(format!("count is {count}: exceeds the address space"))
                })?;
                // SAFETY: as above.
                let fetch = unsafe { desc::read(fetches.with_addr(at), &name) }?;
                ensure!(
                    fetch.struct_size == stride,
                    "{name}.struct_size is {}, but that of fetches[0] is {stride}",
                    fetch.struct_size
                );
                // SAFETY: the host's pointers, valid during the call.
                let (checked, of) = unsafe { fetch.checked(&name) }?;
                if !results.get_or_insert_with(|| of.clone()).is(&of) {
                    let what = if matches!(checked, Checked::Image { .. }) { "tile" } else { "carrier" };
                    return Err(Failure::argument(format!("{name}.{what} belongs to another asset")));
                }
                all.push(checked);
            }
        }
        let mut outputs: Vec<(String, Strips)> = Vec::new();
        for fetch in &all {
            match fetch {
                Checked::Image { name, target, .. } => outputs.push((name.clone(), target.written())),
                Checked::Carried { points, .. } => outputs.extend(points.written.iter().cloned()),
            }
        }
        check_apart(outputs, input)?;
        Ok(Wanted { all, results })
    }

    /// The fetches, to be written once.
    pub fn fetches(&mut self) -> Outcome<Vec<Fetch<'_>>> {
        self.all.iter_mut().map(Checked::fetch).collect()
    }
}

impl Checked<'_> {
    fn fetch(&mut self) -> Outcome<Fetch<'_>> {
        Ok(match self {
            Checked::Image { name, tile, kind, target, whole } => {
                // SAFETY: the host vouches for the memory, and no other view writes to it.
                let image = unsafe { target.view(name) }?;
                let image = match *whole {
                    Some((size, first)) => image.part_of(name, size, first)?,
                    None => image,
                };
                Fetch::Image { tile: *tile, kind: *kind, image }
            }
            Checked::Carried { carrier, points } => {
                Fetch::Carried { carrier, carried: std::mem::take(&mut points.carried) }
            }
        })
    }
}

/// Writes `count` outputs of an asset's last solve into the caller's memory. All are of one and the same solve, even if
/// another one ends meanwhile. Any size is allowed; an output does not depend on other fetches. All tiles and carriers
/// belong to one asset. No two outputs may write the same byte, but they may be interleaved, such as two pairs of
/// channels of one image. `fetches` may be null if `count` is 0.
///
/// Errors: VRTM_ERROR_NOT_SOLVED before a tile's first solve; VRTM_ERROR_UNSUPPORTED for an integer format, or a
/// rectangle of UVs of another set; VRTM_ERROR_INVALID_ARGUMENT for channels that the kind does not have, a rectangle
/// that is not inside the whole image, or outputs that overlap; those of vrtm_carrier_fetch. If a GPU fails while the
/// outputs are written, some may be. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_fetch(fetches: *const vrtm_fetch, count: usize) -> vrtm_status {
    guard("vrtm_asset_fetch", || {
        // SAFETY: the host's pointer, valid during the call.
        let mut wanted = unsafe { Wanted::read(None, fetches, count, 0..0) }?;
        let results = wanted.results.clone();
        let mut fetches = wanted.fetches()?;
        results.map_or(Ok(()), |results| Ok(results.fetch_all(&mut fetches)?))
    })
}

/// Writes the layer of every face in a UV set: which of the tiles with the face's UDIM number has its redirection (see
/// vrtm_mesh_desc.max_layers); 0 for faces in no tile. `count` is the number of faces, vrtm_asset_info.faces. All
/// corners of a face are in its layer. It depends on the mesh alone: no solve is needed, and once per mesh is enough.
/// Make it an attribute of faces, by which a shader picks the layer's map. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_fetch_face_layers(
    asset: vrtm_asset,
    uv_set: u32,
    layers: *mut u32,
    count: usize,
) -> vrtm_status {
    guard("vrtm_asset_fetch_face_layers", || {
        let asset = handle::asset(asset)?;
        let faces = asset.info.faces;
        ensure!(count as u64 == faces, "count is {count}, but the mesh has {faces} faces");
        // SAFETY: the host vouches for `count` numbers during the call.
        let out = unsafe { desc::slice_mut(layers, count, "layers") }?;
        Ok(asset.results.face_layers(uv_set, out)?)
    })
}

/// Writes the redirected UV of every face corner of the mesh in a UV set: `count` pairs (u, v), in corner order, with
/// the tile's offset added as in the mesh's own UVs; 0, 0 at corners of faces without UVs. For hosts that set UVs
/// instead of reading a map. `count` is the number of corners, vrtm_asset_info.corners; `uvs` has room for 2 * count
/// floats.
///
/// Errors: VRTM_ERROR_NOT_SOLVED before the first solve. Never busy. In tiles that have not been solved yet, the UVs
/// are the mesh's own.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_fetch_corner_uvs(
    asset: vrtm_asset,
    uv_set: u32,
    uvs: *mut f32,
    count: usize,
) -> vrtm_status {
    guard("vrtm_asset_fetch_corner_uvs", || {
        let asset = handle::asset(asset)?;
        let corners = asset.info.corners;
        ensure!(count as u64 == corners, "count is {count}, but the mesh has {corners} corners");
        // SAFETY: the host vouches for `count` pairs during the call.
        let out = unsafe { desc::slice_mut(uvs.cast::<[f32; 2]>(), count, "uvs") }?;
        Ok(asset.results.corner_uvs(uv_set, out)?)
    })
}
