//! Both backends on an asset's tile, side by side or one after the other: for tests and support.

use std::sync::Arc;

use crate::allocation::{Collect, filled, zeroed};
use crate::asset::{Asset, torn};
use crate::error::{Error, ErrorKind, Result};
use crate::grid::build;
use crate::grid::maps::MapsOfTile;
use crate::grid::pose::Pose;
use crate::grid::survey::Survey;
use crate::lab::parity::StageDifference;
use crate::lab::parity::pair::Pair;
use crate::method::deadline::Deadline;
use crate::method::plan::{Input, Plan, Purpose};
use crate::method::progress::Progress;
use crate::method::schedule;
use crate::settings::SolveOptions;
use crate::view::Strided;
use crate::{cpu, gpu};

impl Asset {
    /// Solves a tile from the identity on both backends in parallel and reports their difference after each stage; in
    /// `lockstep`, each stage then continues from the CPU's state. The asset's result is unchanged.
    ///
    /// # Errors
    /// `Unsupported` unless the asset is on a GPU; those of [`Asset::solve`].
    #[doc(hidden)]
    pub fn compare_backends(
        &mut self,
        tile: usize,
        positions: Strided,
        options: &SolveOptions,
        lockstep: bool,
    ) -> Result<Vec<StageDifference>> {
        self.check_tile(tile)?;
        self.check_vertices("positions", &positions, 3)?;
        options.check()?;
        let Some(context) = self.device.gpu() else {
            return Err(Error::new(ErrorKind::Unsupported, "the asset is not on a GPU"));
        };
        let (maps, all) = (&self.tiles[tile].maps, self.maps());
        let mesh = match torn::in_pose(&self.mesh, tile, &positions) {
            torn if !Arc::ptr_eq(&torn, &self.mesh.tiles[tile]) => torn,
            _ => self.device.team(|team| self.tiles[tile].source(team, &self.mesh, tile)),
        };
        let mesh = &*mesh;
        let grid = self.device.team(|team| {
            let of_tile = MapsOfTile { own: maps, all: &all };
            let survey = Survey::new(team, mesh, of_tile, maps.grid_size());
            Arc::new(build::grid(team, &self.mesh, of_tile, survey))
        });
        let pose = Pose::new(mesh, |v| positions.get3(v as usize), Some(&grid.rest));
        let charts: Vec<bool> = (0..mesh.charts.len()).map(|c| !grid.is_still(mesh, &pose, c)).collected();
        if !charts.contains(&true) {
            return Ok(Vec::new());
        }
        let settings = &self.tiles[tile].maps.settings;
        let plan = Plan::new(options);
        let continuation = plan.continuation;
        let (protect, pull) = (plan.protect(settings), 0.0);
        let input =
            Input { grid: &grid, mesh, pose: &pose, settings, protect, charts: &charts, continuation, pull };
        self.device.team(|team| {
            let mut of_cpu = cpu::Memory::new(&grid, Purpose::new(plan.solver(), settings));
            let mut of_gpu = gpu::Memory::new(context, &grid, mesh)?;
            let mut u = zeroed(grid.levels[0].blocks.list.len());
            let cpu = cpu::Run::new(team, &input, &mut of_cpu, &mut u, &[]);
            context.contain(|| {
                let gpu = gpu::Run::new(&input, &mut of_gpu, None, &filled(false, charts.len()), None)?;
                let mut pair = Pair::new(cpu, gpu, &grid, &charts, lockstep);
                let (mut deadline, mut progress) = (Deadline::unlimited(), Progress::new(None, 1.0));
                schedule::run(&mut pair, &input, &plan, false, &mut deadline, &mut progress);
                pair.finish()
            })?
        })
    }
}
