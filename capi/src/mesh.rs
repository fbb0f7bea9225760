//! The description of a mesh.

use super::desc::{self, Sized32, sized};
use super::status::{Failure, Outcome};
use super::types::{strided, vrtm_array};
use vrtm_core::allocation::Vec;
use vrtm_core::error::{Error, ErrorKind};
use vrtm_core::mesh::{MeshSource, POSITION_TOLERANCE, UV_TOLERANCE, UvSource, Weld, WeldBy};

/// Rule by which corners of different faces are one corner, so that a chart continues across the edge between
/// them.
pub type vrtm_weld = i32;
/// The same vertex, and UVs within the tolerance; the default. The host's vertices define connectivity: a cut in the
/// modelling program is a cut here, even between lips that are closed at rest, and in every pose.
pub const VRTM_WELD_INDEX: vrtm_weld = 0;
/// As VRTM_WELD_INDEX, and also different vertices whose rest positions lie within the tolerance
/// (vrtm_mesh_desc.weld_position_tolerance): for game meshes, whose vertices are duplicated along hard edges and seams.
/// A pose tears a welded edge if the two vertices at either of its ends lie farther apart, along x, y or z, than ten
/// times the tolerance (with its rounding) plus 8 e times the largest magnitude of their six posed coordinates; e is
/// 2^-23 for f32 positions and 2^-52 for f64. In such a pose charts end at the edge, as if the mesh were cut there, and
/// the log warns.
pub const VRTM_WELD_POSITION: vrtm_weld = 1;
/// The same vertex, and exactly the same UV.
pub const VRTM_WELD_OFF: vrtm_weld = 2;

/// A further UV set of a mesh. Zero it before use. A plain value that never grows.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_uv_set {
    /// UVs as pairs (2 components). Give these, or both `u` and `v`.
    pub uvs: *const vrtm_array,
    /// u of each UV (1 component), where u and v are arrays of their own.
    pub u: *const vrtm_array,
    /// v of each UV (1 component), as many as `u`.
    pub v: *const vrtm_array,
    /// UV of each corner, as in vrtm_mesh_desc; null = one UV per corner, in the order of the corners.
    pub uv_indices: *const u32,
    /// The length of `uv_indices`: the mesh's `index_count`. Ignored when that is null.
    pub uv_index_count: usize,
}

/// A mesh at rest. Start from vrtm_mesh_desc_init(), which sets the tolerances. All arrays are copied before the call
/// returns.
///
/// The corners of a face are consecutive: corner k of the mesh has the vertex indices[k] and the UV uv_indices[k] (or
/// UV k, without uv_indices). Polygons may have any number of corners; they are triangulated. UVs are face-varying, v
/// points up, and a face belongs to the UDIM tile 1001 + floor(u) + 10 floor(v) of its UV centroid.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_mesh_desc {
    /// sizeof(vrtm_mesh_desc); set by vrtm_mesh_desc_init().
    pub struct_size: u32,
    /// Rest positions, 3 components, any unit of length. Required.
    pub positions: *const vrtm_array,
    /// Corners of each face; null = all faces are triangles, unless `face_offsets` is given. Faces with fewer than 3
    /// corners (points, lines) are skipped and counted; their corners still count in the order.
    pub face_counts: *const u32,
    /// Number of faces: the length of `face_counts`. Ignored when that is null.
    pub face_count: usize,
    /// Instead of `face_counts`: the first corner of each face, followed by `index_count`. Null = absent.
    pub face_offsets: *const u32,
    /// The length of `face_offsets`: the number of faces plus 1. Ignored when that is null.
    pub face_offset_count: usize,
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
    /// UV of each corner; null = one UV per corner, in the order of the corners. A face whose corners all have
    /// UINT32_MAX is untextured: it belongs to no tile, but its corners still count in the order.
    pub uv_indices: *const u32,
    /// The length of `uv_indices`: `index_count`. Ignored when that is null.
    pub uv_index_count: usize,
    /// Further UV sets, starting with set 1; the UVs above are set 0. Null = none. Each set has its own tiles.
    pub uv_sets: *const vrtm_uv_set,
    /// The length of `uv_sets`. Ignored when that is null.
    pub uv_set_count: usize,
    /// The faces that carry the texture, each less than the number of faces, in any order; null = all. The other faces
    /// are treated as if they had no UVs.
    pub textured_faces: *const u32,
    /// The length of `textured_faces`. Ignored when that is null.
    pub textured_face_count: usize,
    /// Edges at which charts end in all UV sets: 2 vertices each. Null = none. A pair that is not an edge of any face
    /// has no effect; it is counted, and the log warns.
    pub seams: *const u32,
    /// The number of these edges: half the length of `seams`. Ignored when that is null.
    pub seam_count: usize,
    /// One of VRTM_WELD_: INDEX (0, the default), POSITION, OFF.
    pub weld: vrtm_weld,
    /// Largest distance of vertices that VRTM_WELD_POSITION welds, as a fraction (0..1) of the longest side of the
    /// bounding box at rest; default 1e-5. Unless it is 0, an allowance for rounding is added. A vertex is welded over
    /// at most a quarter of its shortest edge, and one with an edge shorter than half of the tolerance only to vertices
    /// at the same position.
    pub weld_position_tolerance: f64,
    /// Largest difference of welded UVs, in u and in v, 0..1; default 1/2048, half a texel of a map of 1024, and at
    /// most a quarter of the smallest UV height of the triangles at the vertex. Welded corners have the mean of their
    /// UVs. Beside a slit in the UVs that this closes nothing moves (vrtm_tile_info.gap_nodes).
    pub weld_uv_tolerance: f64,
    /// The largest number of layers of a tile, for meshes whose charts lie over one another: mirrored halves, stacked
    /// islands. 0 (the default) or 1: texels that several charts share do not move (see VRTM_OVERLAP_). From 2 on,
    /// charts that lie over others, deeper than by 1/4096, get layers of their own, each a tile with its own
    /// redirection map: vrtm_asset_fetch_face_layers says which map each face reads. Corner UVs and refinements know
    /// the layers. Charts for which the layers do not suffice stay in the last one; a chart that lies over itself does
    /// not move there.
    pub max_layers: u64,
}

// SAFETY: repr(C), struct_size first, plain numbers and raw pointers.
sized!(vrtm_mesh_desc);

impl Default for vrtm_mesh_desc {
    fn default() -> vrtm_mesh_desc {
        vrtm_mesh_desc {
            weld_position_tolerance: POSITION_TOLERANCE,
            weld_uv_tolerance: UV_TOLERANCE,
            ..Sized32::zeroed()
        }
    }
}

/// Reads a UV set; messages name its arrays as fields of `name`.
unsafe fn uv_source<'a>(set: &vrtm_uv_set, name: &str) -> Outcome<UvSource<'a>> {
    let vrtm_uv_set { uvs, u, v, uv_indices, uv_index_count } = *set;
    // SAFETY: all of these are the host's pointers, valid during the call.
    unsafe {
        let indices = desc::slice_or_none(uv_indices, uv_index_count, &format!("{name}.uv_indices"))?;
        let (has_pairs, has_axes) = (!uvs.is_null(), !u.is_null() || !v.is_null());
        ensure!(has_pairs || has_axes, "{name}.uvs is null, and so are {name}.u and {name}.v");
        ensure!(!has_pairs || !has_axes, "{name}.uvs is given, so {name}.u and {name}.v must be null");
        if has_pairs {
            return Ok(UvSource { u: strided(uvs, 2, &format!("{name}.uvs"))?, v: None, indices });
        }
        let u = strided(u, 1, &format!("{name}.u"))?;
        let v = strided(v, 1, &format!("{name}.v"))?;
        Ok(UvSource { u, v: Some(v), indices })
    }
}

fn weld(desc: &vrtm_mesh_desc) -> Outcome<Weld> {
    let by = match desc.weld {
        VRTM_WELD_INDEX => WeldBy::Index,
        VRTM_WELD_POSITION => WeldBy::Position,
        VRTM_WELD_OFF => WeldBy::Off,
        other => return Err(Failure::argument(format!("desc.weld is {other}, no VRTM_WELD_ value"))),
    };
    Ok(Weld {
        by,
        position_tolerance: Some(desc.weld_position_tolerance),
        uv_tolerance: Some(desc.weld_uv_tolerance),
    })
}

/// The UV sets after the first one.
pub(super) unsafe fn more_uvs<'a>(desc: &vrtm_mesh_desc) -> Outcome<Vec<UvSource<'a>>> {
    // SAFETY: the host vouches for `uv_set_count` structs, and for their pointers.
    let sets = unsafe { desc::slice_or_none(desc.uv_sets, desc.uv_set_count, "desc.uv_sets") }?;
    let source = |(k, set)| unsafe { uv_source(set, &format!("desc.uv_sets[{k}]")) };
    sets.unwrap_or_default().iter().enumerate().map(source).collect::<Result<Vec<_>, _>>()
}

pub(super) unsafe fn mesh<'a>(desc: &vrtm_mesh_desc, uv_sets: &'a [UvSource<'a>]) -> Outcome<MeshSource<'a>> {
    let vrtm_mesh_desc { uvs, u, v, uv_indices, uv_index_count, .. } = *desc;
    // SAFETY: all of these are the host's pointers, valid during the call.
    unsafe {
        let positions = strided(desc.positions, 3, "desc.positions")?;
        let face_counts = desc::slice_or_none(desc.face_counts, desc.face_count, "desc.face_counts")?;
        let face_offsets =
            desc::slice_or_none(desc.face_offsets, desc.face_offset_count, "desc.face_offsets")?;
        let indices = desc::slice(desc.indices, desc.index_count, "desc.indices")?;
        let uvs = uv_source(&vrtm_uv_set { uvs, u, v, uv_indices, uv_index_count }, "desc")?;
        let textured_faces =
            desc::slice_or_none(desc.textured_faces, desc.textured_face_count, "desc.textured_faces")?;
        let seams =
            desc::slice_or_none(desc.seams.cast(), desc.seam_count, "desc.seams")?.unwrap_or_default();
        Ok(MeshSource {
            positions,
            face_counts,
            face_offsets,
            indices,
            uvs,
            uv_sets,
            seams,
            textured_faces,
            weld: weld(desc)?,
            max_layers: desc.max_layers.min(u64::from(u32::MAX)) as u32,
        })
    }
}

/// Translates the core's names in a message, such as `uvs.u` and `weld.uv_tolerance`, into those of the C struct.
pub(super) fn in_c_words(error: Error, mesh: &MeshSource) -> Error {
    if error.kind != ErrorKind::InvalidArgument {
        return error;
    }
    let mut message = error.message.replace("weld.", "weld_");
    for (k, set) in std::iter::once(&mesh.uvs).chain(mesh.uv_sets).enumerate() {
        let (core, c) = match k {
            0 => ("uvs".to_owned(), String::new()),
            _ => (format!("uv_sets[{}]", k - 1), format!("uv_sets[{}].", k - 1)),
        };
        message = message
            .replace(&format!("{core}.u"), &format!("{c}{}", if set.v.is_none() { "uvs" } else { "u" }))
            .replace(&format!("{core}.v"), &format!("{c}v"))
            .replace(&format!("{core}.indices"), &format!("{c}uv_indices"));
    }
    Error::argument(format!("desc.{message}"))
}
