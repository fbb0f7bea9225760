//! Carries points, curves and detail meshes that are bound to the rest surface into the pose of the last solve.

pub(super) mod ride;

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use crate::asset::derived::Same;
use crate::asset::results::Results;
use crate::device::Booked;
use vrtm_carry::{Bind, Binding, Course, Fit, Pieces, PointState, bytes_of_features, host_frame};
use vrtm_core::allocation::Vec;
use vrtm_core::error::{Error, Result};
use vrtm_core::grid::Grid;
use vrtm_core::mesh::TileMesh;
use vrtm_core::panics::lock;
use vrtm_core::team::Team;
use vrtm_core::view::{Packed, Strided, StridedMut};

/// Points to bind, and the way they move.
#[derive(Clone, Copy, Debug)]
pub struct CarrierSettings<'a> {
    /// The UV set whose tiles carry the points.
    pub uv_set: u32,
    /// Places of the points.
    pub by: Bind<'a>,
    /// The height of each point above the surface, along its normal; one component.
    pub heights: Option<Strided<'a>>,
    /// The frame of each point at rest, which the rotations then begin from: a quaternion x, y, z, w, or 9 components,
    /// a matrix row by row. Of a matrix its rotation counts, not its scale; a mirrored one stays mirrored in matrices,
    /// and is rotated with its third axis turned over in quaternions.
    pub frames: Option<Strided<'a>>,
    /// Per point, the number of a piece that is one rigid body; `u32::MAX` = no piece. Pieces come before features.
    pub pieces: Option<&'a [u32]>,
    /// Rule for points that move as one body.
    pub fit: Fit,
    /// The height up to which a point of a rigid body is blended from the surface to that body; 0 = not at all.
    pub skirt: f64,
}

/// Sizes of a carrier, and what its points are bound to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct CarrierInfo {
    /// Number of points.
    pub points: u64,
    /// Points outside of all charts. They move with the surface nearest to them, without a warp.
    pub outside: u64,
    /// Points on triangles whose UVs are turned over within their chart; they move with the surface as well.
    pub folded: u64,
    /// Points farther from the surface than the largest distance; they move with the surface as well.
    pub too_far: u64,
    /// Features that points moved with in the last fetch.
    pub features: u64,
    /// The largest distance by which the rim of one of these features left the surface in the last fetch, lifted off
    /// or cut in.
    pub rim: f64,
    /// Bytes held by the carrier, excluding the mesh and the results.
    pub bytes: u64,
    /// Milliseconds that the last fetch took.
    pub ms: f32,
}

/// Destinations of carried points; each array has an element for each point.
#[derive(Debug, Default)]
pub struct Carried<'a> {
    /// Positions in the pose; 3 components.
    pub positions: Option<StridedMut<'a>>,
    /// Rotations from the frames at rest: quaternions x, y, z, w, or 9 components, matrices row by row.
    pub rotations: Option<StridedMut<'a>>,
    /// The stretch of the surface under what is painted that is left, as two factors, the larger first; 2 components.
    pub stretch: Option<StridedMut<'a>>,
    /// UV of the surface point under each point, W(p) for a point painted at p, with the tile's offset; 2 components.
    pub uvs: Option<StridedMut<'a>>,
}

/// Points bound to the rest surface of an asset, which go with it into each pose that is solved from then on.
///
/// A point painted at UV p is on the surface where the texture at p is shown: at f(W(p)), exactly on the triangle
/// there. Its rotation is that of the tangents of f ∘ W from rest to pose, and its height is kept along the normal.
/// Points of a rigid feature move as one body. It keeps the mesh and the results that it needs alive: it may be used
/// while the asset exists and after it is dropped.
///
/// # Example
///
/// ```
/// # use vrtm::{
/// #     Asset, Bind, Carried, CarrierSettings, Device, DeviceSettings, MeshSource, SolveOptions, Strided, StridedMut,
/// #     UvSource,
/// # };
/// # fn main() -> vrtm::Result<()> {
/// let rest = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
/// let uvs = rest.map(|[x, y, _]: [f32; 3]| [x, y]);
/// # let device = Device::new(&DeviceSettings::default())?;
/// # let source = MeshSource {
/// #     positions: Strided::from_slice(&rest),
/// #     face_counts: Some(&[4]),
/// #     indices: &[0, 1, 2, 3],
/// #     uvs: UvSource { u: Strided::from_slice(&uvs), ..UvSource::default() },
/// #     ..MeshSource::default()
/// # };
/// let mut asset = Asset::new(&device, &source)?;
/// // A spike of height 0.1 in the middle.
/// let carrier = asset.carrier(&CarrierSettings {
///     heights: Some(Strided::from_slice(&[0.1])),
///     ..CarrierSettings::new(Bind::Uv { uvs: Strided::from_slice(&[[0.5, 0.5]]), layers: None })
/// })?;
/// let pose = rest.map(|[x, y, z]| [z, y, 2.0 * x]);
/// asset.solve(Strided::from_slice(&pose), &SolveOptions::default())?;
/// let mut positions = [[0.0f32; 3]];
/// carrier.fetch(&Carried { positions: Some(StridedMut::from_slice(&mut positions)), ..Carried::default() })?;
/// assert_eq!(positions, [[-0.1, 0.5, 1.0]]);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Carrier {
    results: Counted,
    binding: Binding,
    frames: Option<Packed>,
    pieces: Option<Pieces>,
    fit: Fit,
    skirt: f64,
    course: Mutex<Option<Arc<Kept>>>,
    info: CarrierInfo,
    /// Of the last fetch: features, the bits of `rim` and of `ms`.
    last: (AtomicU64, AtomicU64, AtomicU32),
    /// Dropped after all fields above.
    _booked: Booked,
}

/// The course of the points on the tiles of results, kept for the next fetch.
#[derive(Debug)]
struct Kept {
    key: Key,
    course: Course,
    booked: Booked,
}

/// Key of a course: per tile, its connectivity, with collars or not, and its grid.
type Key = Vec<Option<(Same<TileMesh>, Option<Same<TileMesh>>, Same<Grid>)>>;

/// Results whose asset has one more carrier.
#[derive(Debug)]
struct Counted(Results);

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.count_carriers(-1);
    }
}

impl<'a> CarrierSettings<'a> {
    /// The defaults: on the surface of UV set 0, features as rigid bodies.
    #[must_use]
    pub fn new(by: Bind<'a>) -> CarrierSettings<'a> {
        let fit = Fit::default();
        CarrierSettings { uv_set: 0, by, heights: None, frames: None, pieces: None, fit, skirt: 0.0 }
    }

    /// Checks everything but the values of indices; returns the number of points.
    fn check(&self) -> Result<usize> {
        let (count, name) = match self.by {
            Bind::Uv { uvs, layers } => {
                check_array("uvs", &uvs, &[2])?;
                check_count("layers", layers.map(<[u32]>::len), uvs.len())?;
                (uvs.len(), "uvs")
            }
            Bind::Corners { corners, weights } => {
                check_array("weights", &weights, &[3])?;
                check_count("weights", Some(weights.len()), corners.len())?;
                (corners.len(), "corners")
            }
            Bind::Nearest { positions, farthest } => {
                check_array("positions", &positions, &[3])?;
                if let Some(farthest) = farthest {
                    ensure!(farthest >= 0.0, "farthest: {farthest} is not at least 0");
                }
                (positions.len(), "positions")
            }
        };
        ensure!(count < u32::MAX as usize, "{name}: {count} are too many");
        for (name, array, components) in
            [("heights", &self.heights, &[1][..]), ("frames", &self.frames, &[4, 9])]
        {
            if let Some(array) = array {
                check_array(name, array, components)?;
                check_count(name, Some(array.len()), count)?;
            }
        }
        if let Some(k) = (0..count).find(|&k| host_frame(self.frames.as_ref(), k).is_none()) {
            let zero = "is zero, or a matrix whose axes lie in a plane: it has no rotation";
            return Err(Error::argument(format!("frames[{k}] {zero}")));
        }
        check_count("pieces", self.pieces.map(<[u32]>::len), count)?;
        ensure!(
            self.skirt >= 0.0 && self.skirt.is_finite(),
            "skirt: {} is not at least 0 and finite",
            self.skirt
        );
        Ok(count)
    }
}

fn check_array(name: &str, array: &Strided, components: &[usize]) -> Result<()> {
    if !array.is_empty() {
        check_components(name, array.components(), components)?;
    }
    // Heights, and distances of positions from the surface, are kept as f32.
    if matches!(name, "heights" | "positions") { array.check_f32(name) } else { array.check_finite(name) }
}

fn check_components(name: &str, given: usize, needed: &[usize]) -> Result<()> {
    ensure!(needed.contains(&given), "{name}: {given} components, but {needed:?} are needed");
    Ok(())
}

fn check_count(name: &str, given: Option<usize>, needed: usize) -> Result<()> {
    let given = given.unwrap_or(needed);
    ensure!(given == needed, "{name}: {given} elements, but there are {needed} points");
    Ok(())
}

impl Results {
    /// Binds points to the rest surface. Nothing is kept of the arrays given.
    ///
    /// # Errors
    /// `InvalidArgument` for corners that are not of one face.
    pub fn carrier(&self, settings: &CarrierSettings) -> Result<Carrier> {
        let mesh = self.mesh();
        mesh.check_uv_set(settings.uv_set)?;
        let count = settings.check()?;
        self.device().call(|| {
            let heights = settings.heights.as_ref();
            let bind =
                |team: &Team| Binding::new(team, mesh, settings.uv_set as usize, &settings.by, heights);
            let binding = self.device().team(bind)?;
            let frames = settings.frames.as_ref().map(Packed::copy);
            let pieces = settings.pieces.map(Pieces::new);
            let mut booked = self.device().booking();
            let of_frames = frames.as_ref().map_or(0, |frames| frames.view().components() * 8 * count);
            let bytes = binding.bytes() + of_frames + pieces.as_ref().map_or(0, Pieces::bytes);
            // With the room for the first fetch, which a carrier without it would be refused.
            let course =
                Course::estimate(mesh, settings.uv_set as usize, &binding, settings.fit, pieces.is_some());
            let pose = if self.count_carriers(0) > 0 { 0 } else { size_of_val(&*mesh.rest) };
            let features = bytes_of_features(self.last().solved().flatten().map(|solved| &*solved.grid));
            let most = (bytes + pose) as u64 + features.max(course as u64);
            booked.set(most, "a carrier with its first fetch")?;
            booked.set(bytes as u64, "a carrier")?;
            let of = |state: PointState| binding.states.iter().filter(|of| **of == state).count() as u64;
            let info = CarrierInfo {
                points: count as u64,
                outside: of(PointState::Outside),
                folded: of(PointState::Folded),
                too_far: of(PointState::Far),
                bytes: bytes as u64,
                ..CarrierInfo::default()
            };
            self.count_carriers(1);
            Ok(Carrier {
                results: Counted(self.clone()),
                binding,
                frames,
                pieces,
                fit: settings.fit,
                skirt: settings.skirt,
                course: Mutex::default(),
                info,
                last: Default::default(),
                _booked: booked,
            })
        })
    }
}

impl Carrier {
    /// Sizes, and what the last fetch found.
    #[must_use]
    pub fn info(&self) -> CarrierInfo {
        let (features, rim, ms) = &self.last;
        let of_course = lock(&self.course).as_ref().map_or(0, |kept| kept.booked.bytes());
        CarrierInfo {
            features: features.load(Ordering::Relaxed),
            rim: f64::from_bits(rim.load(Ordering::Relaxed)),
            ms: f32::from_bits(ms.load(Ordering::Relaxed)),
            bytes: self.info.bytes + of_course,
            ..self.info
        }
    }

    /// Binding of each point.
    #[must_use]
    pub fn states(&self) -> &[PointState] {
        &self.binding.states
    }

    /// Carries the points into the pose of the asset's last solve, and writes what is asked for. The bits do not
    /// depend on the number of threads.
    ///
    /// # Errors
    /// `NotSolved` before the first solve after the carrier was made, which is the first one to keep its pose.
    pub fn fetch(&self, out: &Carried) -> Result<()> {
        self.check(out, "")?;
        let results = self.results();
        results.device().call(|| {
            let last = results.solved_asset()?;
            results.device().team(|team| {
                let ride = self.ride(team, &last)?;
                let positions = ride.pose.positions.view();
                ride.begin(team, &|v| positions.get3(v as usize), out).write(team);
                Ok(())
            })
        })
    }

    /// The results that the points follow.
    #[must_use]
    pub fn results(&self) -> &Results {
        &self.results.0
    }

    /// Checks destinations; `prefix` stands before their names in messages.
    pub(crate) fn check(&self, out: &Carried, prefix: &str) -> Result<()> {
        let arrays = [
            ("positions", &out.positions, &[3][..]),
            ("rotations", &out.rotations, &[4, 9]),
            ("stretch", &out.stretch, &[2]),
            ("uvs", &out.uvs, &[2]),
        ];
        for (name, array, components) in arrays {
            let Some(array) = array else { continue };
            let name = format!("{prefix}{name}");
            check_count(&name, Some(array.len()), self.binding.points.len())?;
            check_components(&name, array.components(), components)?;
        }
        Ok(())
    }
}
