//! Compares the two backends, to find the stage at which they diverge. A [`Pair`](pair::Pair) runs the schedule on both
//! in parallel and compares their states after each stage.

pub mod pair;
mod point;

use std::any::Any;
use std::sync::Arc;

use pair::Pair;
use point::Point;
use vrtm::{Asset, SolveOptions};
use vrtm_core::allocation::zeroed;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::grid::build;
use vrtm_core::grid::maps::MapsOfTile;
use vrtm_core::grid::pose::Pose;
use vrtm_core::grid::survey::Survey;
use vrtm_core::method::deadline::Deadline;
use vrtm_core::method::plan::{Input, Plan, Purpose};
use vrtm_core::method::progress::Progress;
use vrtm_core::method::schedule;
use vrtm_core::view::Strided;
use vrtm_cpu as cpu;
use vrtm_gpu::context::Context;

/// The difference of one quantity between the two backends, after one stage of one tile.
#[doc(hidden)]
#[derive(Clone, Debug, PartialEq)]
pub struct StageDifference {
    /// The stage and its level (0 is the finest), as in `correct@0.2`.
    pub stage: String,
    /// The quantity, with its unit.
    pub quantity: &'static str,
    /// The largest difference; infinite if exactly one of two values is NaN.
    pub max: f64,
    /// The root mean square of the differences; infinite where `max` is.
    pub rms: f64,
    /// The largest magnitude on the CPU.
    pub size: f64,
    /// Number of values that were compared.
    pub count: u64,
    /// Number of values that differ.
    pub different: u64,
}

impl StageDifference {
    /// Compares pairs (CPU, GPU).
    fn new(stage: Point, quantity: &'static str, pairs: impl Iterator<Item = (f64, f64)>) -> StageDifference {
        let (mut max, mut squares, mut size, mut count, mut different) = (0.0f64, 0.0, 0.0f64, 0u64, 0u64);
        for (cpu, gpu) in pairs {
            count += 1;
            if cpu.to_bits() == gpu.to_bits() {
                size = size.max(cpu.abs());
                continue;
            }
            let apart = (cpu - gpu).abs();
            // Two NaNs count as equal, as do 0 and -0.
            let apart = if cpu.is_nan() && gpu.is_nan() || cpu == gpu { 0.0 } else { apart };
            let apart = if apart.is_nan() { f64::INFINITY } else { apart };
            different += u64::from(apart > 0.0);
            max = max.max(apart);
            squares += apart * apart;
            size = size.max(cpu.abs());
        }
        let rms = (squares / count.max(1) as f64).sqrt();
        StageDifference { stage: stage.to_string(), quantity, max, rms, size, count, different }
    }
}

/// Solves a tile from the identity on both backends in parallel and reports their difference after each stage; in
/// `lockstep`, each stage then continues from the CPU's state. The asset's result is unchanged.
///
/// # Errors
/// `Unsupported` unless the asset is on a GPU; those of [`Asset::solve`].
pub fn compare_backends(
    asset: &Asset,
    tile: usize,
    positions: Strided,
    options: &SolveOptions,
    lockstep: bool,
) -> Result<Vec<StageDifference>> {
    options.check()?;
    let inside = asset.tile_inside(tile, &positions)?;
    let gpu = asset.device().gpu().map(|gpu| gpu.clone() as Arc<dyn Any + Send + Sync>);
    let Some(Ok(context)) = gpu.map(Arc::downcast::<Context>) else {
        return Err(Error::new(ErrorKind::Unsupported, "the asset is not on a GPU"));
    };
    let (mesh, maps) = (&*inside.extended, inside.maps);
    let grid = asset.device().team(|team| {
        let of_tile = MapsOfTile { own: maps, all: inside.all_maps };
        let survey = Survey::new(team, mesh, of_tile, maps.grid_size());
        Arc::new(build::grid(team, inside.mesh, of_tile, survey))
    });
    let pose = Pose::new(mesh, |v| positions.get3(v as usize), Some(&grid.rest));
    let charts: Vec<bool> = (0..mesh.charts.len()).map(|c| !grid.is_still(mesh, &pose, c)).collect();
    if !charts.contains(&true) {
        return Ok(Vec::new());
    }
    let settings = &maps.settings;
    let plan = Plan::new(options);
    let continuation = plan.continuation;
    let (harm, pull) = (plan.harm(settings), 0.0);
    let input = Input {
        grid: &grid,
        mesh,
        pose: &pose,
        settings,
        harm,
        multipliers: &[],
        charts: &charts,
        continuation,
        pull,
    };
    asset.device().team(|team| {
        let mut of_cpu = cpu::Memory::new(&grid, Purpose::new(plan.solver(), settings));
        let mut of_gpu = vrtm_gpu::Memory::new(&context, &grid, &[mesh])?;
        let mut u = zeroed(grid.levels[0].blocks.list.len());
        let cpu = cpu::Run::new(team, &input, &mut of_cpu, &mut u, &[]);
        context.contain(|| {
            let gpu = vrtm_gpu::Run::new(&input, &mut of_gpu, None, &vec![false; charts.len()], None)?;
            let mut pair = Pair::new(cpu, gpu, &grid, &charts, lockstep);
            let (deadline, mut progress) = (Deadline::unlimited(), Progress::new(None, 1.0));
            schedule::run(&mut pair, &input, &plan, false, &deadline, &mut progress);
            Ok(pair.finish()?.into())
        })?
    })
}
