//! Time budgets, on a clock that the stages move: by what they cost, at a pace that the schedule has to find out.

use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};
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
use vrtm_core::method::schedule;
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

/// Time of a stage of a cost, both in seconds.
type Seconds<'a> = dyn Fn(&Stage, f64) -> f64 + Sync + 'a;

/// A backend on a machine that takes `seconds` for a stage.
struct Machine<'a, 'b> {
    run: Run<'b>,
    costs: Costs,
    seconds: &'a Seconds<'a>,
}

impl Stages for Machine<'_, '_> {
    fn run(&mut self, stage: &Stage) {
        self.run.run(stage);
        let seconds = (self.seconds)(stage, 1e-6 * self.costs.of(stage));
        NOW.set(NOW.get() + Duration::from_secs_f64(seconds));
    }
}

/// A stretched sheet with rigid discs.
struct Scene {
    mesh: Mesh,
    maps: TileMaps,
    grid: Arc<Grid>,
    positions: Vec<[f64; 3]>,
}

struct Outcome {
    seconds: f64,
    /// The energies of the identity and of the result on level 0.
    energies: [f64; 2],
    summary: Summary,
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

    /// Solves on a machine whose pace is taken for `pace`.
    fn solve(
        &self,
        options: &SolveOptions,
        budget: Option<f64>,
        pace: f64,
        seconds: &Seconds<'_>,
    ) -> Outcome {
        let (tile, grid) = (&self.mesh.tiles[0], &self.grid);
        let plan = Plan::new(options);
        let pose = Pose::new(tile, |v| self.positions[v as usize], Some(&grid.rest));
        let (charts, continuation) = (&[true][..], plan.continuation);
        let settings = &self.maps.settings;
        let input =
            Input { grid, mesh: tile, pose: &pose, settings, protect: 0.0, charts, continuation, pull: 0.0 };
        let mut memory = Memory::new(grid, Purpose::new(options.solver, settings));
        let mut warp = vec![[[0.0; NODES]; 2]; grid.levels[0].blocks.list.len()];
        let mut level_0 = warp.clone();
        Team::with(2, |team| {
            let start = clock();
            let run = Run::new(team, &input, &mut memory, &mut warp, &[]);
            let mut machine = Machine { run, costs: Costs::new(&input, plan.pbd.is_some()), seconds };
            let budget = budget.map(Duration::from_secs_f64);
            let mut deadline = Deadline::new(start, [budget; 2], pace, false);
            deadline.clock = clock;
            let mut progress = Progress::new(None, 1.0);
            let summary = schedule::run(&mut machine, &input, &plan, false, &mut deadline, &mut progress);
            drop(machine);
            let seconds = (clock() - start).as_secs_f64();
            let mut run = Run::new(team, &input, &mut memory, &mut level_0, &warp);
            run.run(&Stage::Surface);
            run.run(&Stage::Start { level: 0, from: Start::Previous });
            run.run(&Stage::Certify { allow_folds: true });
            let energies = [run.results[0].energy_before, run.results[0].energy];
            Outcome { seconds, energies, summary, warp }
        })
    }
}

/// A machine that is this many times slower than the one that costs refer to.
fn slower(pace: f64) -> impl Fn(&Stage, f64) -> f64 {
    move |_, cost| 50e-6 + pace * cost
}

#[test]
#[cfg_attr(miri, ignore = "too long")]
fn half_of_the_time_gives_most_of_the_gain_and_a_quarter_hardly_less() {
    let (scene, options) = (Scene::new(256), SolveOptions::default());
    let whole = scene.solve(&options, None, 1.0, &slower(1.0));
    for (part, least) in [(0.5, 0.95), (0.25, 0.9), (0.1, 0.5)] {
        let found = scene.solve(&options, Some(part * whole.seconds), 1.0, &slower(1.0));
        println!("{part} of the time gives {:.3} of the gain", found.gain() / whole.gain());
        assert!(found.gain() >= least * whole.gain() && found.summary.truncated);
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long")]
fn no_solve_takes_a_fifth_and_5_ms_longer_than_its_budget() {
    let scene = Scene::new(128);
    let pbd = PbdSettings { iterations: 12, ..PbdSettings::default() };
    for solver in [Solver::Descent, Solver::Pbd] {
        let options = SolveOptions { solver, pbd, ..SolveOptions::default() };
        // Charts that are crowded on level 0 alone: trials are repeated, and no further correction is skipped.
        let crowded = |stage: &Stage, cost: f64| match stage {
            Stage::Correct { level: 0, correction } if correction.first => 50e-6 + 30.0 * 1.4 * cost,
            Stage::Correct { level: 0, .. } => 50e-6 + 30.0 * 3.5 * cost,
            _ => 50e-6 + 30.0 * cost,
        };
        let machines: [&Seconds<'_>; 4] = [&slower(0.3), &slower(1.0), &slower(30.0), &crowded];
        for (machine, seconds) in machines.into_iter().enumerate() {
            let whole = scene.solve(&options, None, 1.0, seconds).seconds;
            // What is known of the machine is right, or from a busy or an idle moment.
            let pace = [0.3, 1.0, 30.0, 30.0][machine];
            for (part, known) in
                (1..26).flat_map(|n| [0.5, 1.0, 2.0].map(|k| (0.05 * f64::from(n), k * pace)))
            {
                let budget = part * whole;
                let found = scene.solve(&options, Some(budget), known, seconds);
                assert!(
                    found.seconds <= 1.2 * budget + 5e-3,
                    "{solver:?}, machine {machine}: {part} of {whole:.3} s took {:.3} s",
                    found.seconds / whole
                );
                assert!(found.energies[1] <= found.energies[0], "{solver:?}, machine {machine}, {part}");
            }
        }
    }
}

/// Each stage in turn is held up for 0.15 of the budget: little enough for a result within the grace period.
#[test]
#[cfg_attr(miri, ignore = "too long")]
fn a_busy_moment_of_the_machine_costs_little_of_the_gain() {
    let (scene, options) = (Scene::new(256), SolveOptions::default());
    let whole = scene.solve(&options, None, 1.0, &slower(1.0));
    for (part, least) in [(0.5, 0.9), (0.25, 0.6)] {
        let budget = part * whole.seconds;
        let mut gains = Vec::new();
        for held_up in 0.. {
            let stage = AtomicUsize::new(0);
            let seconds = |_: &Stage, cost: f64| {
                let busy = if stage.fetch_add(1, Ordering::Relaxed) == held_up { 0.15 * budget } else { 0.0 };
                50e-6 + cost + busy
            };
            let found = scene.solve(&options, Some(budget), 1.0, &seconds);
            assert!(found.seconds <= 1.2 * budget + 5e-3, "{part}, {held_up}: {} s", found.seconds);
            gains.push(found.gain() / whole.gain());
            if stage.into_inner() <= held_up {
                break;
            }
        }
        let lowest = gains.iter().copied().fold(f64::MAX, f64::min);
        println!("{part} of the time, one of {} stages held up: {lowest:.3} of the gain", gains.len() - 1);
        assert!(lowest >= least && gains.len() > 10, "{gains:.3?}");
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long")]
fn with_time_enough_nothing_is_left_out_and_without_any_nothing_is_done() {
    let scene = Scene::new(64);
    for solver in [Solver::Descent, Solver::Pbd] {
        let options = SolveOptions { solver, ..SolveOptions::default() };
        let whole = scene.solve(&options, None, 1.0, &slower(1.0));
        let enough = scene.solve(&options, Some(3600.0), 1.0, &slower(1.0));
        assert!(!enough.summary.truncated && enough.warp == whole.warp);
        assert_eq!(enough.summary.corrections, whole.summary.corrections);
        let nothing = scene.solve(&options, Some(1e-9), 1.0, &slower(100.0));
        assert!(
            nothing.summary.truncated && nothing.warp.as_flattened().as_flattened().iter().all(|u| *u == 0.0)
        );
        assert_eq!((nothing.summary.sweeps, nothing.summary.corrections), (0, 0));
    }
}
