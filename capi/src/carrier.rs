//! Carriers: points that ride on the warped surface.

use super::desc::{self, Sized32, sized};
use super::guard::{guard, guard_struct, guard_value};
use super::handle::{self, Kind, Table, vrtm_asset, vrtm_carrier};
use super::mirror::{Mirror, choice, mirror};
use super::status::{Failure, Outcome, vrtm_status};
use super::strips::{Strips, check_apart};
use super::types::{strided, vrtm_array, vrtm_array_out, vrtm_carried};
use vrtm::{Bind, Carried, Carrier, CarrierInfo, CarrierSettings, Fit, PointState};
use vrtm_core::allocation::Vec;
use vrtm_core::error::Error;
use vrtm_core::view::{Scalar, Strided, StridedMut};

/// Kind of place by which the points of a carrier are given.
pub type vrtm_bind = i32;
/// `uvs`, among all tiles of the UV set, and `layers`; the default. A point less than 1.5e-5 beside a chart is put on
/// its border.
pub const VRTM_BIND_UV: vrtm_bind = 0;
/// `corners`, three of one face for each point, and `weights`. For a triangle these are its three corners and
/// barycentric coordinates; for a polygon any three, such as those of the host's own triangle.
pub const VRTM_BIND_CORNERS: vrtm_bind = 1;
/// `positions`: the nearest point of the surface at rest. What is left of the distance is kept in the point's frame,
/// so that a detail mesh keeps its form.
pub const VRTM_BIND_NEAREST: vrtm_bind = 2;

choice! {
    FITS: vrtm_fit of Fit { VRTM_FIT_FEATURE = 0: Feature, VRTM_FIT_SURFACE = 1: Surface, VRTM_FIT_NONE = 2: None }
}

choice! {
    STATES: vrtm_point_state of PointState {
        VRTM_POINT_BOUND = 0: Bound, VRTM_POINT_OUTSIDE = 1: Outside,
        VRTM_POINT_FOLDED = 2: Folded, VRTM_POINT_FAR = 3: Far,
    }
}

/// The points of a carrier. Start from vrtm_carrier_desc_init(). All arrays have an element for each point, and are
/// copied before the call returns; those that `bind` does not name are ignored.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_carrier_desc {
    /// sizeof(vrtm_carrier_desc); set by vrtm_carrier_desc_init().
    pub struct_size: u32,
    /// The UV set whose tiles carry the points: 0 <= uv_set < vrtm_asset_info.uv_sets.
    pub uv_set: u32,
    /// One of VRTM_BIND_: UV (0, the default), CORNERS, NEAREST.
    pub bind: vrtm_bind,
    /// One of VRTM_FIT_: FEATURE (0, the default), SURFACE, NONE.
    pub fit: vrtm_fit,
    /// VRTM_BIND_UV: UVs, 2 components, with the tile's offset added, as in the mesh's own. `uvs->count`,
    /// `weights->count` or `positions->count` is the number of points, which may be 0.
    pub uvs: *const vrtm_array,
    /// VRTM_BIND_UV: the layer of each point (vrtm_mesh_desc.max_layers); null = the first layer that has a chart
    /// there.
    pub layers: *const u32,
    /// VRTM_BIND_CORNERS: three corners of one face for each point, as corners of the mesh are counted.
    pub corners: *const u32,
    /// VRTM_BIND_CORNERS: the weights of these corners, 3 components, of which only the ratio matters.
    pub weights: *const vrtm_array,
    /// VRTM_BIND_NEAREST: positions at rest, 3 components.
    pub positions: *const vrtm_array,
    /// VRTM_BIND_NEAREST: the largest distance from the surface, in the unit of the positions; 0 = any.
    pub farthest: f64,
    /// The height of each point above the surface, in the unit of the positions, along the normal, which is
    /// interpolated between vertices; 1 component; null = 0. Seen from its side, the corners of faces run
    /// counter-clockwise.
    pub heights: *const vrtm_array,
    /// The frame of each point at rest, from which its rotations begin: quaternions x, y, z, w, 4 components, not all
    /// of them 0; null = the axes of the mesh.
    pub frames: *const vrtm_array,
    /// Instead of `frames`: matrices row by row, 9 components, of which the rotation counts, not the scale. The axes
    /// must not lie in a plane. A mirrored matrix stays mirrored in vrtm_carried.matrices; in vrtm_carried.rotations
    /// it is rotated with its third axis turned over. Null = absent.
    pub matrices: *const vrtm_array,
    /// For hosts that know their pieces: the number of the piece that a point belongs to, which moves as one rigid
    /// body; UINT32_MAX = none. Null = no pieces. A piece whose points lie on a line, as far as positions of f32 tell,
    /// is none.
    pub pieces: *const u32,
    /// The height up to which a point of a rigid body is blended from the surface (at height 0) to that body; 0 (the
    /// default) = not at all.
    pub skirt: f64,
}

mirror! {
    report vrtm_carrier_info of r: CarrierInfo {
        ms: f32, points: u64, outside: u64, folded: u64, too_far: u64, features: u64, rim: f64, bytes: u64,
    }
}

// SAFETY: repr(C), struct_size first, plain numbers and raw pointers.
sized!(vrtm_carrier_desc);

pub(super) static CARRIERS: Table<Carrier> = Table::new(Kind::Carrier, "carrier");

/// Binds points to the rest surface of an asset, for what is geometry on it and not painted: studs, scales, spikes,
/// hair roots, decals. Curves and detail meshes are points, whose connectivity the host keeps.
///
/// A carrier follows the solves that come after it was created. A point painted at UV p is where the texture at p is
/// shown: at f(W(p)), exactly on the triangle there, f being the surface in the pose and W the warp. Its rotation is
/// that of the tangents of f o W from rest to the pose, and its height is kept along the normal. With
/// VRTM_FIT_FEATURE, points where the rigidity is over 0.75 move with their feature, a connected region with a
/// rigidity over 0.5, as one rigid body, beyond seams as well; between 0.5 and 0.75 they are blended to the surface.
/// Points that cannot be bound are counted in vrtm_carrier_info, and move with the surface alone.
///
/// The caller destroys `*carrier`. It keeps the data that it needs alive, including the mesh and the last result, and
/// may be used after the asset is destroyed. Never busy.
///
/// Errors: VRTM_ERROR_INVALID_ARGUMENT for corners that are not of one face.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_carrier_create(
    asset: vrtm_asset,
    desc: *const vrtm_carrier_desc,
    carrier: *mut vrtm_carrier,
) -> vrtm_status {
    guard_value("vrtm_carrier_create", carrier, "carrier", || {
        let asset = handle::asset(asset)?;
        // SAFETY: the host vouches for its pointers.
        let carrier = unsafe {
            let d = desc::read(desc, "desc")?;
            let (by, count) = match d.bind {
                VRTM_BIND_UV => {
                    let uvs = of_points(d.uvs, 2, "desc.uvs")?;
                    let layers = desc::slice_or_none(d.layers, uvs.len(), "desc.layers")?;
                    (Bind::Uv { uvs, layers }, uvs.len())
                }
                VRTM_BIND_CORNERS => {
                    let weights = of_points(d.weights, 3, "desc.weights")?;
                    let corners = match weights.len() {
                        0 => &[],
                        count => desc::slice(d.corners.cast(), count, "desc.corners")?,
                    };
                    (Bind::Corners { corners, weights }, weights.len())
                }
                VRTM_BIND_NEAREST => {
                    let positions = of_points(d.positions, 3, "desc.positions")?;
                    let farthest = (d.farthest != 0.0).then_some(d.farthest);
                    (Bind::Nearest { positions, farthest }, positions.len())
                }
                other => return Err(Failure::argument(format!("desc.bind is {other}, no VRTM_BIND_ value"))),
            };
            let or_none = |array: *const vrtm_array, components, name| {
                (!array.is_null()).then(|| of_points(array, components, name)).transpose()
            };
            let frames = or_none(d.frames, 4, "desc.frames")?;
            let matrices = or_none(d.matrices, 9, "desc.matrices")?;
            ensure!(frames.is_none() || matrices.is_none(), "desc.frames and desc.matrices are both given");
            let settings = CarrierSettings {
                uv_set: d.uv_set,
                heights: or_none(d.heights, 1, "desc.heights")?,
                frames: frames.or(matrices),
                pieces: desc::slice_or_none(d.pieces, count, "desc.pieces")?,
                fit: Fit::from_c(d.fit, "desc.fit")?,
                skirt: d.skirt,
                ..CarrierSettings::new(by)
            };
            // In Rust both are one argument.
            let name = if matrices.is_some() { "matrices" } else { "frames" };
            let named = |e: Error| Error::new(e.kind, e.message.replacen("frames", name, 1));
            asset.results.carrier(&settings).map_err(named)?
        };
        Ok(vrtm_carrier { id: CARRIERS.add(carrier)? })
    })
}

/// Gets the sizes of a carrier, the points that could not be bound, and what the last fetch found. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_carrier_get_info(
    carrier: vrtm_carrier,
    info: *mut vrtm_carrier_info,
) -> vrtm_status {
    guard_struct("vrtm_carrier_get_info", info, "info", || {
        Ok(CARRIERS.get("carrier", carrier.id)?.info().into())
    })
}

/// Carries the points into the pose of the asset's last solve, and writes what `carried` asks for. The result depends
/// on that solve and on the carrier alone. Never busy: it reads the last good result, even during a solve.
///
/// Errors: VRTM_ERROR_NOT_SOLVED before the first solve after vrtm_carrier_create, unless the asset had another carrier
/// in its last one: poses from before are not kept; VRTM_ERROR_INVALID_ARGUMENT if elements overlap.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_carrier_fetch(
    carrier: vrtm_carrier,
    carried: *const vrtm_carried,
) -> vrtm_status {
    guard("vrtm_carrier_fetch", || {
        let carrier = CARRIERS.get("carrier", carrier.id)?;
        // SAFETY: the host vouches for its pointers.
        let Points { carried, written } =
            unsafe { Points::read(carried, "carried", carrier.states().len()) }?;
        check_apart(written, 0..0)?;
        Ok(carrier.fetch(&carried)?)
    })
}

/// Writes the state of each point, one of VRTM_POINT_, to `count` elements: vrtm_carrier_info.points. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_carrier_fetch_states(
    carrier: vrtm_carrier,
    states: *mut vrtm_point_state,
    count: usize,
) -> vrtm_status {
    guard("vrtm_carrier_fetch_states", || {
        let carrier = CARRIERS.get("carrier", carrier.id)?;
        let of_points = carrier.states();
        ensure!(count == of_points.len(), "count is {count}, but the carrier has {} points", of_points.len());
        if count == 0 {
            return Ok(());
        }
        // SAFETY: the host vouches for `count` elements during the call.
        let out = unsafe { desc::slice_mut(states, count, "states") }?;
        out.iter_mut().zip(of_points).for_each(|(out, state)| *out = state.to_c());
        Ok(())
    })
}

/// Destroys a carrier. Calls that are using it run to their end; the memory is freed afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_carrier_destroy(carrier: vrtm_carrier) -> vrtm_status {
    guard("vrtm_carrier_destroy", || CARRIERS.remove(carrier.id).map(drop))
}

/// Destinations of carried points, checked but for overlaps.
pub(super) struct Points<'a> {
    pub carried: Carried<'a>,
    /// The name of each array, and the bytes that are written to it.
    pub written: Vec<(String, Strips)>,
}

impl<'a> Points<'a> {
    /// Reads the destinations `name` of `count` points.
    pub unsafe fn read(carried: *const vrtm_carried, name: &str, count: usize) -> Outcome<Points<'a>> {
        // SAFETY: the host's pointer.
        let c = unsafe { desc::read(carried, name) }?;
        ensure!(
            c.rotations.is_null() || c.matrices.is_null(),
            "{name}.rotations and {name}.matrices are both given"
        );
        let mut written = Vec::new();
        let mut array = |array: *const vrtm_array_out, components, field| -> Outcome<Option<StridedMut>> {
            if array.is_null() {
                return Ok(None);
            }
            let name = format!("{name}.{field}");
            // SAFETY: the host's pointers.
            let (view, strips) = unsafe { destination(array, components, &name, count) }?;
            written.push((name, strips));
            Ok(Some(view))
        };
        let positions = array(c.positions, 3, "positions")?;
        let rotations = array(c.rotations, 4, "rotations")?.or(array(c.matrices, 9, "matrices")?);
        let stretch = array(c.stretch, 2, "stretch")?;
        let uvs = array(c.uvs, 2, "uvs")?;
        Ok(Points { carried: Carried { positions, rotations, stretch, uvs }, written })
    }
}

/// The array `name` of the host's with an element for each point, of which there may be none: an empty scatter on one
/// of many meshes is common.
unsafe fn of_points<'a>(array: *const vrtm_array, components: usize, name: &str) -> Outcome<Strided<'a>> {
    // SAFETY: the host's pointer.
    match unsafe { desc::read(array, name) }?.count {
        0 => Ok(Strided::new(name, &[], Scalar::F32, components, 0, 0)?),
        // SAFETY: passed on.
        _ => unsafe { strided(array, components, name) },
    }
}

/// The array `name` of the host's, and the bytes of its elements.
unsafe fn destination<'a>(
    array: *const vrtm_array_out,
    components: usize,
    name: &str,
    count: usize,
) -> Outcome<(StridedMut<'a>, Strips)> {
    // SAFETY: the host's pointer.
    let array = unsafe { desc::read(array, name) }?;
    ensure!(array.count == count, "{name}.count is {}, but the carrier has {count} points", array.count);
    // It is checked as an input of the same layout is.
    let input = vrtm_array {
        format: array.format,
        data: array.data.cast_const(),
        count,
        stride: array.stride,
        ..Sized32::zeroed()
    };
    // SAFETY: the host vouches for the memory.
    unsafe { of_points(&raw const input, components, name) }?;
    let scalar = Scalar::from_c(array.format, &format!("{name}.format"))?;
    let size = scalar.size() * components;
    let stride = if array.stride == 0 { size } else { array.stride };
    let steps = [(count, stride), (usize::from(count > 0), stride * count)];
    let strips = Strips { start: array.data.addr(), size, steps };
    // SAFETY: as above; the caller checks that nothing overlaps.
    let view = unsafe { StridedMut::from_raw(array.data.cast(), scalar, components, count, stride) };
    Ok((view, strips))
}
