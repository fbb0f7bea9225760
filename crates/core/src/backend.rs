//! The interface of a backend: the memory of a tile's solver and its solves, which the CPU has, too; and, for GPUs,
//! adapters, an open GPU, results in its memory, and images of them. All calls through these traits are calls for a
//! whole tile or image.

use std::any::Any;
use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

use crate::allocation::{Vec, zeroed};
use crate::error::Result;
use crate::grid::Grid;
use crate::grid::planes::Plane;
use crate::image::external::ExternalTexels;
use crate::image::format::PixelFormat;
use crate::mesh::TileMesh;
use crate::method::deadline::Deadline;
use crate::method::plan::{ChartResult, Input, Plan, Purpose, Summary};
use crate::method::progress::Progress;
use crate::method::schedule;
use crate::method::stage::Stages;
use crate::report::{AdapterInfo, GpuWork};
use crate::team::Team;

/// The memory that a backend keeps from one solve of a tile to the next, or of several tiles as one ([`Grid::joined`]).
pub trait TileSolver: Debug + Send + Sync {
    /// True if this memory is for this purpose on this grid (grids of other sizes or maps have other blocks).
    fn is_for(&self, grid: &Arc<Grid>, purpose: Purpose) -> bool;

    /// Solves the requested charts.
    fn run(&mut self, solve: &mut TileSolve) -> Result<TileSolution>;
}

/// One solve of one tile, or of several as one.
pub struct TileSolve<'a> {
    pub team: &'a Team,
    pub input: Input<'a>,
    pub plan: &'a Plan,
    /// The time limit.
    pub deadline: Deadline,
    /// The progress of the solve.
    pub progress: Progress,
    /// Per tile, its last result on the same grid.
    pub lasts: &'a [Option<&'a Warp>],
    /// Charts that are not solved keep their last result if this is true for them, and become the identity otherwise.
    pub keep: &'a [bool],
}

/// The result of a solve.
pub struct TileSolution {
    pub warp: Warp,
    /// Per chart; meaningful for the solved charts.
    pub charts: Vec<ChartResult>,
    /// Per feature, its multiplier at the end (method §4, Harm).
    pub multipliers: Vec<f32>,
    pub summary: Summary,
    pub node_updates: u64,
    pub blocks_active: u64,
    /// The GPU's dispatches, submissions and transfers.
    pub work: Option<GpuWork>,
}

/// Displacements in cells, per block of the finest level.
#[derive(Debug)]
pub enum Warp {
    Host(Vec<[Plane; 2]>),
    Gpu(Box<dyn GpuWarp>),
}

impl Warp {
    /// The warp in a GPU's memory, if it is there.
    pub fn on_gpu(&self) -> Option<&dyn GpuWarp> {
        match self {
            Warp::Host(_) => None,
            Warp::Gpu(u) => Some(&**u),
        }
    }

    /// The displacements in host memory; read from the GPU on first use.
    pub fn host(&self) -> Result<&[[Plane; 2]]> {
        match self {
            Warp::Host(u) => Ok(u),
            Warp::Gpu(u) => u.host(),
        }
    }
}

impl<'a> TileSolve<'a> {
    /// The last result of a tile that is solved alone.
    fn last(&self) -> Option<&'a Warp> {
        self.lasts.first().copied().flatten()
    }

    /// The last result in host memory if the solve starts from it or is pulled towards it, otherwise empty.
    pub fn anchor(&self) -> Result<&'a [[Plane; 2]]> {
        self.last().filter(|_| self.plan.warm).map_or(Ok(&[]), Warp::host)
    }

    /// Runs the schedule, if a chart has to be solved.
    pub fn run_schedule(&mut self, stages: &mut impl Stages) -> Summary {
        let warm = self.plan.warm && self.lasts.iter().any(Option::is_some);
        if self.input.charts.contains(&true) {
            schedule::run(stages, &self.input, self.plan, warm, &self.deadline, &mut self.progress)
        } else {
            Summary::default()
        }
    }

    /// The initial displacements in host memory: the last result for charts that keep it and are not solved, the
    /// identity elsewhere. Pages of the identity are not touched until they are written.
    pub fn initial_displacements(&self) -> Result<Vec<[Plane; 2]>> {
        let blocks = &self.input.grid.levels[0].blocks;
        let mut u = zeroed(blocks.list.len());
        let stays = |c: usize| self.keep[c] && !self.input.charts[c];
        if let Some(last) = self.last().filter(|_| (0..self.keep.len()).any(stays)) {
            let last = last.host()?;
            for (_, range) in blocks.of_chart.iter().enumerate().filter(|(c, _)| stays(*c)) {
                u[range.clone()].copy_from_slice(&last[range.clone()]);
            }
        }
        Ok(u)
    }
}

/// Options for opening a GPU.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// True to open with WebGPU's default limits (bindings of 128 MiB, buffers of 256 MiB) and no optional feature
    /// instead of the adapter's capabilities: for tests, and to tell a driver's defect from one of this library.
    pub webgpu_limits: bool,
    /// Most blocks of a level, if fewer than fit into a buffer: for tests of grids that are too large.
    pub most_blocks: Option<usize>,
}

/// The adapters that backends have found on this machine.
#[derive(Default)]
pub struct Adapters {
    /// Of each backend, hardware before software, discrete before integrated; otherwise in the order of the drivers.
    pub usable: Vec<Adapter>,
    /// Name of each adapter that cannot be used, with the reason.
    pub rejected: Vec<String>,
    /// The graphics interfaces that were looked through.
    pub interfaces: Vec<&'static str>,
}

/// A GPU that can be used.
pub struct Adapter {
    pub info: AdapterInfo,
    /// Opens it. `Unsupported`, with the driver's reason.
    pub open: Box<dyn Fn(Options) -> Result<Arc<dyn Gpu>>>,
}

impl Adapters {
    /// Describes the GPUs that can be used.
    pub fn infos(&self) -> Vec<AdapterInfo> {
        self.usable.iter().map(|adapter| adapter.info.clone()).collect()
    }

    /// Lists the adapters found, for an error message.
    pub fn listed(&self) -> String {
        let usable = self.usable.iter().map(|Adapter { info, .. }| {
            if info.software { format!("{}, a software driver", info.name) } else { info.name.clone() }
        });
        let all: Vec<String> = usable.chain(self.rejected.iter().cloned()).collect();
        if all.is_empty() { "none".to_owned() } else { all.join("; ") }
    }
}

/// An open GPU.
pub trait Gpu: Any + Debug + Send + Sync {
    /// The description of its adapter.
    fn info(&self) -> &AdapterInfo;

    /// Returns `DeviceLost` if the GPU was lost.
    fn alive(&self) -> Result<()>;

    /// Releases the memory of what was dropped, without waiting. Call it after the buffers of a tile or an asset are
    /// dropped.
    fn reclaim(&self);

    /// Destroys the GPU's device, as if it were lost: for tests.
    fn lose(&self);

    /// Sets whether each kernel is timed separately from now on, which costs some time.
    fn time_kernels(&self, yes: bool);

    /// Bytes that `solver` allocates.
    fn solver_bytes(&self, grid: &Grid, tiles: &[&TileMesh]) -> u64;

    /// Allocates the solver of a tile, or of several with their joined grid.
    fn solver(self: Arc<Self>, grid: &Arc<Grid>, tiles: &[&TileMesh]) -> Result<Box<dyn TileSolver>>;

    /// True if tiles with these grids get the same results, bit for bit, from a solve together.
    fn are_alike(&self, a: &Grid, b: &Grid) -> bool;

    /// Most blocks of a level: those of one tile, or of all tiles that are solved together.
    fn most_blocks(&self) -> usize;

    /// Bytes that `output` allocates; `None` if images of this size cannot be written.
    fn output_bytes(&self, size: [usize; 2], format: PixelFormat) -> Option<u64>;

    /// Allocates the buffers through which images of this size and format, two channels each, reach the host.
    fn output(self: Arc<Self>, size: [usize; 2], format: PixelFormat) -> Result<Box<dyn GpuOutput>>;

    /// Bytes of GPU memory that `write_external` needs in addition to the host's memory.
    fn external_bytes(&self, texels: &ExternalTexels) -> Result<u64>;

    /// Writes a redirection of a grid with so many cells to the memory of a host's graphics device, and waits until
    /// it is complete. `u` is `None` for the identity. Values are measured from the texel's centre, or, with an
    /// `origin`, from the corner (0, 0) of the tile that is there as seen from the mesh's tile.
    fn write_external(
        &self,
        u: Option<&dyn GpuWarp>,
        cells: [usize; 2],
        origin: Option<[u32; 2]>,
        texels: &ExternalTexels,
    ) -> Result<()>;
}

/// A warp in a GPU's memory.
pub trait GpuWarp: Any + Debug + Send + Sync {
    /// The displacements per block of level 0; the first call reads them from the GPU.
    fn host(&self) -> Result<&[[Plane; 2]]>;

    /// The part of a warp of several tiles that is one tile's: these blocks.
    fn part(&self, grid: &Arc<Grid>, blocks: Range<usize>) -> Box<dyn GpuWarp>;
}

/// Buffers through which images reach the host, kept from one fetch to the next.
pub trait GpuOutput: Debug + Send + Sync {
    /// True if the buffers can hold an image of this size and format.
    fn holds(&self, size: [usize; 2], format: PixelFormat) -> bool;

    /// Calls `read(row, texels)` for bands of texel rows, from v = 0 upward; `row` is the band's first row. Texels are
    /// W⁻¹(c) - c in cells, exactly 0 where nothing moved. The buffers must hold f32.
    fn invert(
        &self,
        u: &dyn GpuWarp,
        size: [usize; 2],
        read: &mut dyn FnMut(usize, &[[f32; 2]]),
    ) -> Result<()>;

    /// Calls `read(row, bytes)` for the same bands, with a redirection's texels: two channels of `format`, measured
    /// from where `write_external` measures them.
    fn redirect(
        &self,
        u: &dyn GpuWarp,
        size: [usize; 2],
        origin: Option<[u32; 2]>,
        format: PixelFormat,
        read: &mut dyn FnMut(usize, &[u8]),
    ) -> Result<()>;
}
