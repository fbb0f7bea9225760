//! The last good results of an asset, which any thread may read at any time, even while the next ones are computed.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, TryLockError};

use crate::device::{Booked, Device, LiveAsset};
use vrtm_core::allocation::Vec;
use vrtm_core::clock::Instant;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::grid::maps::TileMaps;
use vrtm_core::image::ImageViewMut;
use vrtm_core::mesh::{Mesh, TileMesh};
use vrtm_core::panics::lock;
use vrtm_core::report::{AssetReport, report};
use vrtm_core::team::Team;
use vrtm_core::unwind::caught;
use vrtm_core::view::{Packed, Strided};

use super::stretch::Stretch;
use crate::map::fetch::{self, Output};
use crate::map::inverse::Outputs;
use crate::solved::Solved;

/// The last good results of an asset. A clone is another handle to the same results; any thread may keep and read it
/// while the asset is in use, and after it is dropped. A read sees the complete results of one solve: a solve that
/// succeeds replaces all of them at once. If the device's GPU is lost, reading returns `DeviceLost`.
#[derive(Clone, Debug)]
pub struct Results(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    device: Device,
    mesh: Arc<Mesh>,
    /// Locked only briefly, to read or replace the pointer.
    last: Mutex<Arc<Last>>,
    outputs: Mutex<Outputs>,
    /// Number of carriers, for which solves keep their poses.
    carriers: AtomicUsize,
    /// Dropped after all fields above.
    _live: LiveAsset,
}

/// The results of all tiles, published together.
#[derive(Debug, Default)]
pub(crate) struct Last {
    /// Per tile.
    pub tiles: Vec<Option<TileResult>>,
    /// Wall-clock milliseconds of the last solve; `None` before the first.
    pub solved_ms: Option<f32>,
    /// The stretch of the last pose.
    pub stretch: Stretch,
    /// The last pose, if there were carriers.
    pub pose: Option<Arc<KeptPose>>,
}

impl Last {
    /// Per tile, its result.
    pub fn solved(&self) -> impl Iterator<Item = Option<&Solved>> {
        self.tiles.iter().map(|tile| Some(&*tile.as_ref()?.solved))
    }
}

/// Inputs of carriers from a solve, besides its results.
#[derive(Debug)]
pub(crate) struct KeptPose {
    pub positions: Packed,
    /// The maps of all tiles.
    pub maps: Vec<TileMaps>,
    /// Dropped after them.
    _booked: Booked,
}

impl KeptPose {
    pub fn new(device: &Device, positions: &Strided, maps: &[TileMaps]) -> Result<KeptPose> {
        let mut booked = device.booking();
        let element = positions.components() as u64 * if positions.epsilon() < 1e-10 { 8 } else { 4 };
        booked.set(positions.len() as u64 * element, "the pose for carriers")?;
        Ok(KeptPose {
            positions: Packed::copy(positions),
            maps: maps.iter().cloned().collect(),
            _booked: booked,
        })
    }
}

#[derive(Clone, Debug)]
pub(crate) struct TileResult {
    pub solved: Arc<Solved>,
    /// True if the last solve skipped the tile.
    pub kept: bool,
    /// True if it is of an earlier pose because a time budget left no time for the tile.
    pub late: bool,
}

impl Results {
    pub(crate) fn new(device: &Device, mesh: &Arc<Mesh>) -> Results {
        Results(Arc::new(Shared {
            device: device.clone(),
            mesh: mesh.clone(),
            last: Mutex::default(),
            outputs: Mutex::default(),
            carriers: AtomicUsize::new(0),
            _live: LiveAsset::new(device),
        }))
    }

    /// Index of the tile of a UV set with this UDIM number, or of its first layer.
    #[must_use]
    pub fn find_tile_of_set(&self, uv_set: u32, udim: u32) -> Option<usize> {
        self.0.mesh.tiles.iter().position(|tile| tile.udim == udim && tile.uv_set == uv_set)
    }

    /// The layer of each face in a UV set: which of the tiles with its UDIM number it belongs to; 0 for a face in no
    /// tile.
    pub fn face_layers(&self, uv_set: u32, out: &mut [u32]) -> Result<()> {
        let mesh = &self.0.mesh;
        mesh.check_uv_set(uv_set)?;
        let layers = mesh.face_layers(uv_set as usize);
        let (given, faces) = (out.len(), layers.len());
        ensure!(given == faces, "layers: {given} elements, but the mesh has {faces} faces");
        out.iter_mut().zip(layers).for_each(|(out, layer)| *out = layer);
        Ok(())
    }

    pub(crate) fn device(&self) -> &Device {
        &self.0.device
    }

    pub(crate) fn mesh(&self) -> &Arc<Mesh> {
        &self.0.mesh
    }

    /// True if both are of the same asset.
    #[doc(hidden)]
    #[must_use]
    pub fn is(&self, other: &Results) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Counts the carriers of the asset, one more or less; returns how many there were.
    pub(crate) fn count_carriers(&self, change: isize) -> usize {
        self.0.carriers.fetch_add(change as usize, Ordering::Relaxed)
    }

    pub(crate) fn last(&self) -> Arc<Last> {
        lock(&self.0.last).clone()
    }

    pub(crate) fn replace(&self, last: Last) {
        let last = Arc::new(last);
        // The old results are dropped after the lock is released.
        let _old = std::mem::replace(&mut *lock(&self.0.last), last);
    }

    pub(super) fn write(&self, team: &Team, output: Output, image: &mut ImageViewMut) -> Result<()> {
        let start = Instant::now();
        let device = &self.0.device;
        let solved = output.solved;
        let write = |outputs: &mut Outputs| caught(|| output.write(device, team, outputs, image));
        let limited = match self.0.outputs.try_lock() {
            Ok(mut outputs) => write(&mut outputs)?,
            Err(TryLockError::Poisoned(poisoned)) => write(&mut poisoned.into_inner())?,
            // Another thread is fetching: calls never wait for each other, so this one uses its own memory.
            Err(TryLockError::WouldBlock) => write(&mut Outputs::default())?,
        };
        if let Some(limited) = limited {
            solved.limited.set(&limited);
        }
        solved.set_invert_ms(start.elapsed().as_secs_f32() * 1000.0);
        Ok(())
    }

    /// Redirected UV of every face corner of a UV set, in corner order, with the tile's offset added; 0, 0 at corners
    /// of faces without UVs. In tiles that have not been solved yet, they are the mesh's own UVs.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn corner_uvs(&self, uv_set: u32, out: &mut [[f32; 2]]) -> Result<()> {
        let Shared { device, mesh, .. } = &*self.0;
        mesh.check_uv_set(uv_set)?;
        let corners = &mesh.corners[uv_set as usize];
        let (given, needed) = (out.len(), corners.len());
        ensure!(given == needed, "uvs: {given} elements, but the mesh has {needed} corners");
        device.call(|| {
            let last = self.solved_asset()?;
            let tiles: Vec<_> = last.solved().collect();
            device.team(|team| fetch::corner_uvs(team, corners, &tiles, out))
        })
    }

    /// The report of the last solve over all tiles.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn report(&self) -> Result<AssetReport> {
        let last = self.solved_asset()?;
        let mut report = report!(AssetReport {
            tiles: last.tiles.len() as u32,
            min_jacobian: 1.0,
            total_ms: last.solved_ms.unwrap_or_default(),
            scale: last.stretch.median as f32,
            scale_spread: last.stretch.spread as f32,
            stretched_share: last.stretch.share as f32,
        });
        for result in last.tiles.iter().flatten() {
            let tile = result.solved.report();
            report.truncated |= result.late;
            if result.kept {
                report.tiles_kept += 1;
                report.charts_reused += tile.charts_active + tile.charts_reused;
            } else {
                report.tiles_active += u32::from(tile.charts_active > 0);
                report.charts_active += tile.charts_active;
                report.charts_reused += tile.charts_reused;
                report.nodes_active += tile.nodes_active;
                report.truncated |= tile.truncated;
            }
            report.charts_identity += tile.charts_identity;
            report.min_jacobian = report.min_jacobian.min(tile.min_jacobian);
            report.folds += tile.folds;
            report.bytes += tile.bytes;
        }
        Ok(report)
    }

    pub(super) fn check_tile(&self, tile: usize) -> Result<()> {
        let count = self.0.mesh.tiles.len();
        ensure!(tile < count, "tile: index {tile} is out of range, there are {count}");
        Ok(())
    }

    pub(crate) fn solved(&self, tile: usize) -> Result<TileResult> {
        self.0.device.alive()?;
        self.check_tile(tile)?;
        self.last().tiles.get(tile).cloned().flatten().ok_or_else(|| self.not_solved(tile))
    }

    pub(super) fn not_solved(&self, tile: usize) -> Error {
        let TileMesh { udim, uv_set, .. } = *self.0.mesh.tiles[tile];
        let message = format!("tile {udim} of UV set {uv_set} has no result yet: solve first");
        Error::new(ErrorKind::NotSolved, message)
    }

    /// All results; `NotSolved` before the first solve.
    pub(crate) fn solved_asset(&self) -> Result<Arc<Last>> {
        self.0.device.alive()?;
        let last = self.last();
        if last.solved_ms.is_some() { Ok(last) } else { Err(not_solved()) }
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        *lock(&self.last) = Arc::default();
        *lock(&self.outputs) = Outputs::default();
        if let Some(gpu) = self.device.gpu() {
            gpu.reclaim();
        }
    }
}

pub(crate) fn not_solved() -> Error {
    Error::new(ErrorKind::NotSolved, "there is no result yet: solve first")
}
