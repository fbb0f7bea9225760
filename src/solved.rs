//! A good solve of a tile.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use glam::DVec2;

use vrtm_beyond::gutter::{Gutter, LimitedTexels};
use vrtm_core::allocation::Vec;
use vrtm_core::backend::Warp;
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::{Plane, slot};
use vrtm_core::mesh::{NONE, TileMesh};
use vrtm_core::method::plan::ChartResult;
use vrtm_core::report::{GpuWork, TileReport};
use vrtm_core::settings::Overlap;
use vrtm_cpu::invert;

/// A tile's last good solve.
#[derive(Clone, Debug)]
pub(crate) struct Solved {
    /// The tile with the connectivity of the pose, in which welds may be torn.
    pub mesh: Arc<TileMesh>,
    /// The tile with collars, if it was solved with them.
    pub extended: Option<Arc<TileMesh>>,
    /// The grid it was solved on, which may be older than the maps.
    pub grid: Arc<Grid>,
    pub warp: Arc<Warp>,
    pub results: Vec<ChartResult>,
    /// Per feature of the grid, its multiplier (method §4, Harm).
    pub multipliers: Vec<f32>,
    /// The overlap setting of the solve.
    pub overlap: Overlap,
    /// The report at the time of the solve; `report()` adds what later fetches change.
    pub report: TileReport,
    /// Milliseconds of the latest inversion: the bits of an f32.
    pub invert_ms: Arc<AtomicU32>,
    /// The room for redirections beyond the borders of charts, if charts go on there.
    pub gutter: Option<Arc<Gutter>>,
    /// Texels of the latest redirection that it limited.
    pub limited: Arc<LimitedTexels>,
    /// The GPU's dispatches, submissions and transfers.
    pub work: Option<GpuWork>,
}

impl Solved {
    /// Bytes of the result of a solve on a grid.
    pub fn bytes_for(grid: &Grid) -> u64 {
        (grid.levels[0].blocks.list.len() * size_of::<[Plane; 2]>()) as u64
    }

    /// The same result with its warp stored elsewhere.
    pub fn with_warp(&self, warp: Arc<Warp>) -> Solved {
        // Nothing has been fetched from it yet.
        Solved { warp, invert_ms: Arc::default(), limited: Arc::default(), ..self.clone() }
    }

    /// The report for the host.
    pub fn report(&self) -> TileReport {
        let mut report = self.report;
        report.times.invert = f32::from_bits(self.invert_ms.load(Ordering::Relaxed));
        (report.texels_limited, report.max_limit) = self.limited.read();
        report
    }

    pub fn set_invert_ms(&self, ms: f32) {
        self.invert_ms.store(ms.to_bits(), Ordering::Relaxed);
    }

    /// The redirected UV of a corner, or of another point of a triangle; input and output include the tile's offset.
    /// `None` where nothing moves. `u` are the displacements, `triangle` is a number in `TileMesh::chart_of`.
    pub fn redirected(&self, u: &[[Plane; 2]], triangle: u32, uv: [f64; 2]) -> Option<[f64; 2]> {
        let level = &self.grid.levels[0];
        let (origin, cells) = (self.mesh.origin(), level.cells());
        let at = DVec2::from(uv) - origin;
        let redirected = |chart: u32| {
            let reach = self.results[chart as usize].max_displacement;
            let p = invert::point(level, u, chart, (at * cells).to_array(), reach)?;
            let to = (DVec2::from(p) / cells).to_array();
            let gutter = self.gutter.as_ref().filter(|_| self.is_beyond(chart, p));
            let limited = gutter.and_then(|gutter| gutter.limit(chart, at.to_array(), to));
            Some((DVec2::from(limited.unwrap_or(to)) + origin).into())
        };
        self.candidates(self.mesh.chart_of[triangle as usize]).find_map(redirected)
    }

    /// True if the cell of a point, in cells, is not wholly in the chart itself.
    fn is_beyond(&self, chart: u32, [x, y]: [f64; 2]) -> bool {
        let blocks = &self.grid.levels[0].blocks;
        [(0, 0), (1, 0), (0, 1), (1, 1)].into_iter().any(|(di, dj)| {
            let (i, j) = (x.floor() as i64 + di, y.floor() as i64 + dj);
            let b = blocks.find(chart, i >> 4, j >> 4);
            b == NONE || {
                let triangle = self.grid.triangle[b as usize][slot((i & 15) as usize, (j & 15) as usize)];
                triangle as usize >= self.mesh.triangles.len()
            }
        })
    }

    /// Charts whose warp may move a corner of `chart`: itself, and if the first face owns shared texels, any chart.
    fn candidates(&self, chart: u32) -> impl Iterator<Item = u32> + use<> {
        // A chart with a collar shares nothing.
        let collars = self.extended.clone();
        let shares = move |chart: u32| {
            collars.as_ref().is_none_or(|tile| tile.charts[chart as usize].collar.is_empty())
        };
        let any = self.overlap == Overlap::FirstFace && shares(chart);
        let others = if any { self.results.len() as u32 } else { 0 };
        std::iter::once(chart).chain((0..others).filter(move |&other| other != chart && shares(other)))
    }
}
