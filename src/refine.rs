//! Refines the mesh so that corner UVs approximate the redirection closely: for hosts that support UV sets only.

pub(crate) mod pattern;

use glam::DVec2;
use vrtm_core::allocation::Vec;
use vrtm_core::clock::Instant;
use vrtm_core::error::Result;
use vrtm_core::grid::planes::Plane;

use crate::asset::results::Results;
use crate::map::nodes::NodeRows;
use crate::solved::Solved;
use vrtm_core::team::Team;
use vrtm_refine::{Redirection, Redirections, RefinedMesh};

/// Default number of triangles that a refinement may add.
const ADDED_TRIANGLES: u64 = 1_000_000;
/// Most triangles: beyond this, 32 bits cannot count their corners.
const MOST_TRIANGLES: u64 = 1 << 30;

/// Settings of a refinement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefinementSettings {
    /// The UV set, less than [`crate::AssetInfo::uv_sets`].
    pub uv_set: u32,
    /// Largest error of linear interpolation on a triangle, in UV of a tile, over 0 and at most 1; default 1/2048, half
    /// a texel of a texture of 1024. Halving it needs up to three times as many triangles.
    pub tolerance: f64,
    /// Maximum number of triangles of the refined mesh, where a polygon of n corners counts as n - 2; `None` = a
    /// million more than the mesh has. If the limit is reached, the largest errors are split first.
    pub max_triangles: Option<u64>,
}

impl Default for RefinementSettings {
    fn default() -> RefinementSettings {
        RefinementSettings { uv_set: 0, tolerance: 1.0 / 2048.0, max_triangles: None }
    }
}

/// Sizes and accuracy of a refinement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct RefinementInfo {
    /// The UV set.
    pub uv_set: u32,
    /// The tolerance, in UV of a tile.
    pub tolerance: f64,
    /// Vertices: those of the mesh, then the new ones.
    pub vertices: u64,
    /// Faces: triangles, and those polygons of the mesh that need no split.
    pub faces: u64,
    /// Corners of all faces: the length of its array of corner UVs.
    pub corners: u64,
    /// Triangles, a polygon of n corners counting as n - 2.
    pub triangles: u64,
    /// Largest remaining error, in UV of a tile, for the result that the refinement was created or last extended for.
    pub error: f64,
    /// True if `error` is within the tolerance; otherwise there were too many triangles.
    pub reached: bool,
    /// Bytes held by the refinement, excluding the mesh and the results.
    pub bytes: u64,
    /// Milliseconds that the creation or the last extension took.
    pub ms: f32,
}

/// The mesh with its triangles split where linear interpolation of redirected corner UVs errs by more than a tolerance.
///
/// It keeps the mesh and the results that it needs alive: it may be used while the asset exists and after it is
/// dropped. A clone can be extended separately.
#[derive(Clone, Debug)]
pub struct Refinement {
    results: Results,
    mesh: RefinedMesh,
    most: u64,
    info: RefinementInfo,
}

impl Results {
    /// Refines the mesh for the present results, so that linear interpolation of the redirected corner UVs is within
    /// the tolerance of the redirection everywhere on each triangle.
    ///
    /// Edges are split at their middle for all faces that share them, also across seams and borders of charts, so that
    /// no cracks open. Faces that need no split stay as they are. Where the warp is the identity, nothing is split. The
    /// refinement depends on the results and the settings alone.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn refine(&self, settings: &RefinementSettings) -> Result<Refinement> {
        let RefinementSettings { uv_set, tolerance, max_triangles } = *settings;
        let (device, mesh) = (self.device(), self.mesh());
        mesh.check_uv_set(uv_set)?;
        ensure!(tolerance > 0.0 && tolerance <= 1.0, "tolerance: {tolerance} is not over 0 and at most 1");
        self.solved_asset()?;
        device.call(|| {
            let start = Instant::now();
            let mesh = RefinedMesh::new(mesh, uv_set as usize);
            let most =
                max_triangles.unwrap_or(mesh.base_triangles() as u64 + ADDED_TRIANGLES).min(MOST_TRIANGLES);
            let info = RefinementInfo { uv_set, tolerance, ..RefinementInfo::default() };
            let mut refinement = Refinement { results: self.clone(), mesh, most, info };
            refinement.refine(start)?;
            Ok(refinement)
        })
    }
}

impl Refinement {
    /// Refines further, for the present results. Existing splits remain: a refinement that was extended for each frame
    /// of a shot has one topology for all of them. Vertices keep their numbers, and new ones follow; faces and corners
    /// are renumbered.
    ///
    /// # Errors
    /// `OutOfMemory`, `DeviceLost`; the refinement is then unchanged.
    pub fn extend(&mut self) -> Result<()> {
        let device = self.results.device().clone();
        device.call(|| {
            let start = Instant::now();
            let mut next = self.clone();
            next.refine(start)?;
            *self = next;
            Ok(())
        })
    }

    /// Sizes of the refinement, and the error it reached.
    #[must_use]
    pub fn info(&self) -> RefinementInfo {
        self.info
    }

    /// The redirected UV of each corner of the refined mesh in the present results, with the tile's offset added; 0, 0
    /// at corners of faces without UVs. At corners of the mesh they are bit-identical to those of
    /// [`Results::corner_uvs`].
    pub fn corner_uvs(&self, out: &mut [[f32; 2]]) -> Result<()> {
        self.check("uvs", out.len(), self.info.corners, "corners")?;
        self.results.device().call(|| {
            let uvs = self.with_results(false, |team, results| Ok(self.mesh.redirected(team, results)))?;
            let mut at = 0;
            self.mesh.visit(
                self.results.mesh(),
                |_, _| (),
                |corner| {
                    out[at] = uvs[corner.uv_point as usize].map(|x| x as f32);
                    at += 1;
                },
            );
            Ok(())
        })
    }

    /// Splits for the present results, and records the sizes and the error.
    fn refine(&mut self, start: Instant) -> Result<()> {
        let (most, tolerance) = (self.most as usize, self.info.tolerance);
        let mut refined = self.mesh.clone();
        let mesh = self.results.mesh();
        let (error, reached) = self
            .with_results(true, |team, results| Ok(refined.refine(team, mesh, results, tolerance, most)))?;
        let (mut faces, mut corners) = (0, 0);
        refined.visit(
            mesh,
            |_, count| {
                faces += 1;
                corners += u64::from(count);
            },
            |_| (),
        );
        self.info = RefinementInfo {
            vertices: (mesh.rest.len() + refined.new_vertices().len()) as u64,
            faces,
            corners,
            triangles: refined.triangles() as u64,
            error,
            reached,
            bytes: refined.bytes() as u64,
            ms: start.elapsed().as_secs_f32() * 1000.0,
            ..self.info
        };
        self.mesh = refined;
        Ok(())
    }

    /// Calls `f` with the present results.
    fn with_results<R: Send>(
        &self,
        with_edges: bool,
        f: impl FnOnce(&Team, &Redirections) -> Result<R> + Send,
    ) -> Result<R> {
        let last = self.results.solved_asset()?;
        // Tiles of other UV sets are not needed.
        let of_set = |solved: &&Solved| solved.mesh.uv_set == self.info.uv_set;
        self.results.device().team(|team| {
            let tiles = last.solved().map(|solved| {
                let of = solved.filter(of_set);
                of.map(|solved| Ok(TileRedirection { solved, u: solved.warp.host()? })).transpose()
            });
            let tiles = tiles.collect::<Result<Vec<_>>>()?;
            f(team, &Redirections::new(team, &tiles, with_edges)?)
        })
    }

    fn check(&self, name: &str, given: usize, needed: u64, of: &str) -> Result<()> {
        ensure!(given as u64 == needed, "{name}: {given} elements, but the refinement has {needed} {of}");
        Ok(())
    }
}

/// The result of a tile, with its displacements in host memory.
struct TileRedirection<'a> {
    solved: &'a Solved,
    u: &'a [[Plane; 2]],
}

impl Redirection for TileRedirection<'_> {
    fn cells(&self) -> [usize; 2] {
        let level = &self.solved.grid.levels[0];
        [level.nx, level.ny]
    }

    fn origin(&self) -> DVec2 {
        self.solved.mesh.origin()
    }

    fn visit_moved(&self, f: &mut dyn FnMut([usize; 2], [f32; 2])) -> Result<()> {
        NodeRows::new(self.solved)?.visit_moved(f);
        Ok(())
    }

    fn redirected(&self, triangle: u32, uv: [f64; 2]) -> Option<[f64; 2]> {
        self.solved.redirected(self.u, triangle, uv)
    }
}
