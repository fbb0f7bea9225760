//! A carrier on the results of a solve: made ready, posed, and written.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use glam::DMat3;

use super::{Carried, Carrier, Kept, Key};
use crate::asset::derived::Same;
use crate::asset::results::{KeptPose, Last, TileResult};
use crate::solved::Solved;
use vrtm_carry::{Carriage, Course, Parts, Tile, bytes_of_features};
use vrtm_core::allocation::Vec;
use vrtm_core::clock::Instant;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::panics::lock;
use vrtm_core::team::Team;
use vrtm_core::view::{Packed, StridedMut};
use vrtm_cpu::prefetch::prefetch;

/// Points that one item of work carries.
const CHUNK: usize = 1024;
/// Points from the one that is written to the one whose place in the host's arrays is asked for: it may be anywhere.
const AHEAD: usize = 16;

impl Carrier {
    /// Makes ready to carry the points into the pose of results, which may not be published yet.
    pub(crate) fn ride<'a>(&'a self, team: &Team, last: &'a Last) -> Result<Ride<'a>> {
        let start = Instant::now();
        let pose = last.pose.as_ref().ok_or_else(|| {
            let why = "carrier: there was no solve since it was made, and poses from before are not kept";
            Error::new(ErrorKind::NotSolved, why)
        })?;
        let mesh = self.results().mesh();
        let mut tiles: Vec<Tile> = Vec::with_capacity(mesh.tiles.len());
        for (k, maps) in pose.maps.iter().enumerate() {
            tiles.push(match &last.tiles[k] {
                // It has a pose nevertheless.
                None => Tile { mesh: &mesh.tiles[k], extended: None, grid: None, maps, u: &[] },
                Some(TileResult { solved, .. }) => Tile {
                    mesh: &solved.mesh,
                    extended: solved.extended.as_deref(),
                    grid: Some(&solved.grid),
                    maps,
                    u: solved.warp.host()?,
                },
            });
        }
        let kept = self.course(team, last, &tiles)?;
        Ok(Ride { carrier: self, kept, pose, tiles, spent: start.elapsed() })
    }

    /// The points' course on these results: the last one, if it is of the same meshes and grids.
    fn course(&self, team: &Team, last: &Last, tiles: &[Tile]) -> Result<Arc<Kept>> {
        let of = |solved: &Solved| {
            (Same::of(&solved.mesh), solved.extended.as_ref().map(Same::of), Same::of(&solved.grid))
        };
        let key: Key = last.tiles.iter().map(|tile| tile.as_ref().map(|tile| of(&tile.solved))).collect();
        if let Some(kept) = lock(&self.course).clone().filter(|kept| kept.key == key) {
            return Ok(kept);
        }
        let mut booked = self.results.0.device().booking();
        booked.set(bytes_of_features(tiles.iter().filter_map(|tile| tile.grid)), "a carrier's features")?;
        let frames = self.frames.as_ref().map(Packed::view);
        let mesh = self.results.0.mesh();
        let course =
            Course::new(team, mesh, tiles, &self.binding, frames.as_ref(), self.pieces.as_ref(), self.fit);
        booked.set(course.bytes() as u64, "a carrier's course")?;
        let kept = Arc::new(Kept { key, course, booked });
        *lock(&self.course) = Some(kept.clone());
        Ok(kept)
    }
}

/// A carrier with the results that it follows.
pub(crate) struct Ride<'a> {
    carrier: &'a Carrier,
    kept: Arc<Kept>,
    pub pose: &'a KeptPose,
    tiles: Vec<Tile<'a>>,
    spent: Duration,
}

/// A carrier in a pose: all that writing its points needs.
pub(crate) struct Begun<'a> {
    ride: &'a Ride<'a>,
    carriage: Carriage<'a>,
    out: &'a Carried<'a>,
    spent: Duration,
}

impl Ride<'_> {
    /// Poses the surface and the features for these destinations. `position` gives the pose's vertices.
    pub fn begin<'a>(
        &'a self,
        team: &Team,
        position: &'a (dyn Fn(u32) -> [f64; 3] + Sync),
        out: &'a Carried<'a>,
    ) -> Begun<'a> {
        let start = Instant::now();
        let Carrier { results, binding, pieces, fit, skirt, .. } = self.carrier;
        let mesh = results.0.mesh();
        let (course, pieces) = (&self.kept.course, pieces.as_ref());
        let on_surface = out.rotations.is_some() || out.stretch.is_some() || out.uvs.is_some();
        let parts = Parts { mesh, binding, course, pieces, fit: *fit, skirt: *skirt, on_surface };
        let carriage = Carriage::new(team, parts, &self.tiles, position);
        Begun { ride: self, carriage, out, spent: self.spent + start.elapsed() }
    }
}

impl Begun<'_> {
    /// Writes the points. Cannot fail.
    pub fn write(&self, team: &Team) {
        let start = Instant::now();
        let Begun { ride: Ride { carrier, kept, pose, .. }, carriage, out, spent } = self;
        // Heights and features have the size of those that the surface shows.
        let factor = pose.positions.view().factor();
        let count = carrier.binding.points.len();
        let on_surface = out.stretch.is_some() || out.uvs.is_some();
        team.run(count.div_ceil(CHUNK), |chunk| {
            for n in chunk * CHUNK..((chunk + 1) * CHUNK).min(count) {
                if let Some(next) = carriage.number(n + AHEAD) {
                    let arrays = [&out.positions, &out.rotations, &out.stretch, &out.uvs];
                    arrays.into_iter().flatten().for_each(|array| prefetch(array.address(next)));
                }
                let Some(k) = carriage.number(n) else { return };
                let carried = carriage.carry(n, out.rotations.is_some(), on_surface);
                put(&out.positions, k, (carried.position / factor).to_array());
                match &out.rotations {
                    Some(array) if array.components() == 9 => {
                        let mut axes = DMat3::from_quat(carried.rotation);
                        if carriage.is_mirrored(n) {
                            axes.z_axis = -axes.z_axis;
                        }
                        put(&out.rotations, k, axes.transpose().to_cols_array());
                    }
                    rotations => put(rotations, k, carried.rotation.to_array()),
                }
                put(&out.stretch, k, carried.stretch);
                put(&out.uvs, k, carried.uv.to_array());
            }
        });
        let (features, rim, ms) = &carrier.last;
        features.store(kept.course.features() as u64, Ordering::Relaxed);
        rim.store(carriage.rim.to_bits(), Ordering::Relaxed);
        let spent = (*spent + start.elapsed()).as_secs_f32() * 1000.0;
        ms.store(spent.to_bits(), Ordering::Relaxed);
    }
}

/// Writes what is carried of point `k`, if it is asked for.
#[inline(always)]
fn put<const N: usize>(array: &Option<StridedMut>, k: usize, values: [f64; N]) {
    if let Some(array) = array {
        // SAFETY: each point belongs to one item of work.
        unsafe { array.put(k, values) };
    }
}
