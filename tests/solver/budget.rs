//! Time budgets, on a clock that the stages move by what they cost.

use std::cell::Cell;
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use vrtm_core::allocation::{Vec, vec};
use vrtm_core::clock::Instant;
use vrtm_core::fixtures::{discs, maps, posed, sheet};
use vrtm_core::grid::Grid;
use vrtm_core::grid::maps::TileMaps;
use vrtm_core::grid::planes::{NODES, Plane};
use vrtm_core::grid::pose::Pose;
use vrtm_core::mesh::Mesh;
use vrtm_core::method::cost::Costs;
use vrtm_core::method::deadline::Deadline;
use vrtm_core::method::plan::Purpose;
use vrtm_core::method::plan::{Input, Plan, Summary};
use vrtm_core::method::progress::Progress;
use vrtm_core::method::schedule::{self, SMALL_LEVEL_BLOCKS};
use vrtm_core::method::stage::{Stage, Stages, Start};
use vrtm_core::settings::{PbdSettings, SolveOptions, Solver, TileSettings};
use vrtm_core::team::Team;
use vrtm_cpu::{Memory, Run};

thread_local! {
    static NOW: Cell<Duration> = const { Cell::new(Duration::ZERO) };
}

fn clock() -> Instant {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    *START + NOW.get()
}

/// A backend on a machine on which each stage takes the time of its cost.
struct Machine<'a> {
    run: Run<'a>,
    costs: Costs,
    stages: Vec<Stage>,
}

impl Stages for Machine<'_> {
    fn run(&mut self, stage: &Stage) {
        self.run.run(stage);
        self.stages.push(*stage);
        NOW.set(NOW.get() + seconds(&self.costs, stage));
    }
}

fn seconds(costs: &Costs, stage: &Stage) -> Duration {
    Duration::from_secs_f64(1e-6 * costs.of(stage))
}

/// A stretched sheet with rigid discs.
struct Scene {
    mesh: Mesh,
    maps: TileMaps,
    grid: Arc<Grid>,
    positions: Vec<[f64; 3]>,
}

struct Outcome {
    time: Duration,
    /// The energies of the identity and of the result on level 0.
    energies: [f64; 2],
    summary: Summary,
    stages: Vec<Stage>,
    /// The longest time of a level's start, its first step, and the step that may end it.
    longest: Duration,
    warp: Vec<[Plane; 2]>,
}

impl Outcome {
    fn gain(&self) -> f64 {
        1.0 - self.energies[1] / self.energies[0]
    }
}

impl Scene {
    fn new(cells: u32) -> Scene {
        let mesh = sheet(4, |u, v| [u, v, 0.0]);
        let settings = TileSettings { grid: [Some(cells); 2], ..TileSettings::default() };
        let maps = maps(64, settings, discs);
        let grid = Arc::new(Grid::new(&mesh, &mesh.tiles[0], &maps));
        let positions = posed(4, |u, v| [u + 0.4 * (u - 0.4).clamp(-0.2, 0.3), v + 0.1 * u * u, 0.0]);
        Scene { mesh, maps, grid, positions }
    }

    fn solve(&self, options: &SolveOptions, budget: Option<Duration>) -> Outcome {
        let (tile, grid) = (&self.mesh.tiles[0], &self.grid);
        let plan = Plan::new(options);
        let pose = Pose::new(tile, |v| self.positions[v as usize], Some(&grid.rest));
        let (charts, continuation) = (&[true][..], plan.continuation);
        let settings = &self.maps.settings;
        let input = Input {
            grid,
            mesh: tile,
            pose: &pose,
            settings,
            harm: 0.0,
            multipliers: &[],
            charts,
            continuation,
            pull: 0.0,
        };
        let mut memory = Memory::new(grid, Purpose::new(options.solver, settings));
        let mut warp = vec![[[0.0; NODES]; 2]; grid.levels[0].blocks.list.len()];
        let mut level_0 = warp.clone();
        Team::with(2, |team| {
            let start = clock();
            let run = Run::new(team, &input, &mut memory, &mut warp, &[]);
            let mut machine = Machine { run, costs: Costs::new(&input), stages: Vec::new() };
            let deadline = Deadline::new(start, budget, clock);
            let mut progress = Progress::new(None, 1.0);
            let summary = schedule::run(&mut machine, &input, &plan, false, &deadline, &mut progress);
            let time = clock() - start;
            let Machine { costs, stages, .. } = machine;
            let of_level = |level| {
                let step = plan.step(level, 0, false).expect("a step");
                let last = step.last_instead().map_or(Duration::ZERO, |last| seconds(&costs, &last));
                seconds(&costs, &plan.start(level)) + seconds(&costs, &step) + last
            };
            let longest = (0..=plan.coarsest(grid)).map(of_level).max().expect("a level");
            let mut run = Run::new(team, &input, &mut memory, &mut level_0, &warp);
            run.run(&Stage::Surface);
            run.run(&Stage::Start { level: 0, from: Start::Previous });
            run.run(&Stage::Certify { allow_folds: true });
            let energies = [run.results[0].energy_before, run.results[0].energy];
            Outcome { time, energies, summary, stages, longest, warp }
        })
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long")]
fn a_part_of_the_time_gives_most_of_the_gain() {
    let (scene, options) = (Scene::new(256), SolveOptions::default());
    let whole = scene.solve(&options, None);
    for (part, least) in [(0.5, 0.9), (0.25, 0.8), (0.1, 0.5)] {
        let found = scene.solve(&options, Some(whole.time.mul_f64(part)));
        println!("{part} of the time gives {:.3} of the gain", found.gain() / whole.gain());
        assert!(found.gain() >= least * whole.gain() && found.summary.truncated);
    }
}

/// Without any time, the small levels are solved; with some, at most one level is begun before the end and not done.
#[test]
#[cfg_attr(miri, ignore = "too long")]
fn small_levels_always_run_and_no_other_begins_after_the_end() {
    let scene = Scene::new(128);
    for solver in [Solver::Descent, Solver::Pbd] {
        let pbd = PbdSettings { iterations: 12, ..PbdSettings::default() };
        let options = SolveOptions { solver, pbd, ..SolveOptions::default() };
        let none = scene.solve(&options, Some(Duration::ZERO));
        assert!(none.summary.truncated && none.energies[1] < none.energies[0], "{solver:?}");
        let is_step = |stage: &&Stage| matches!(stage, Stage::Correct { .. } | Stage::Iterate { .. });
        let levels: Vec<usize> = none.stages.iter().filter(is_step).map(Stage::level).collect();
        let blocks = |level: usize| scene.grid.levels[level].blocks.list.len();
        for level in 0..=Plan::new(&options).coarsest(&scene.grid) {
            assert_eq!(levels.contains(&level), blocks(level) <= SMALL_LEVEL_BLOCKS, "{solver:?}, {level}");
        }
        assert!(!levels.contains(&0) && levels.len() > 1, "{solver:?}: {levels:?}");
        let whole = scene.solve(&options, None);
        for budget in (1..26).map(|n| whole.time.mul_f64(0.05 * f64::from(n))) {
            let found = scene.solve(&options, Some(budget));
            assert!(found.time <= budget + found.longest + none.time, "{solver:?}: {:?}", found.time);
            assert!(found.energies[1] < found.energies[0], "{solver:?}, {budget:?}");
            assert!(!found.summary.truncated || budget < whole.time, "{solver:?}, {budget:?}");
            let is_whole = found.warp == whole.warp && found.summary.corrections == whole.summary.corrections;
            assert!(found.summary.truncated || is_whole, "{solver:?}, {budget:?}");
        }
    }
}
