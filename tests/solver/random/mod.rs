//! Random small models: for every valid input the result is certified. Each failure that was ever found is a case in
//! `named.rs`.
//!
//! A run without variables draws a part of the models of a long run, another one every day. `VRTM_RANDOM_CASES=200000`
//! draws that number of other models, from a seed that is printed; `VRTM_RANDOM_SEED` sets the seed.

mod borders;
mod build;
mod check;
mod named;
mod recipe;
mod strategy;

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use check::Seen;
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::{Config, RngAlgorithm, TestError, TestRng, TestRunner};
use recipe::Recipe;
use vrtm::{Backend, Device, DeviceSettings};
use vrtm_testkit::{gpu, long};

/// Number of models of a long run, and of those that a GPU solves as well: a software one takes tens of milliseconds
/// for each. A short run has a fortieth of them, from day to day others.
const CASES: u64 = 10_000;
const GPU_CASES: u64 = 200;

/// Number of models drawn from one seed: a failure hides the rest of its batch, and not more.
const BATCH: u64 = 100;

/// Time after which a solve counts as hanging. No model takes half a second on an idle machine.
const HANG: Duration = Duration::from_secs(120);

fn variable(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{name}: {text} is not a number")))
}

/// Number of cases and first seed of a run. `divisor` reduces the number in VRTM_RANDOM_CASES.
fn plan(all: u64, divisor: u64) -> (u64, u64) {
    let Some(cases) = variable("VRTM_RANDOM_CASES") else {
        let few = long::cases(all, all / 40, "random models");
        let seed = if few < all { long::seed() % (all / BATCH).max(1) } else { 0 };
        println!("VRTM_SEED={seed}");
        return (few, seed);
    };
    let now = || std::time::UNIX_EPOCH.elapsed().map_or(1, |t| t.as_secs() << 20);
    let seed = variable("VRTM_RANDOM_SEED").unwrap_or_else(now);
    println!("VRTM_RANDOM_SEED={seed}");
    ((cases / divisor).max(1), seed)
}

/// Prints a recipe as Rust source: `Debug` prints vectors and arrays alike, so `vec!` is added to the vectors by name.
fn as_rust(recipe: &Recipe) -> String {
    let text = format!("{recipe:?}").replace("pieces: [", "pieces: vec![");
    let (head, tail) = text.split_once("frames: [").unwrap();
    let (frames, rest) = tail.split_once("], output").unwrap();
    // Each frame is a list of moves; a scale has a list of numbers inside.
    let frames = frames.replace("Scale([", "Scale(<").replace('[', "vec![").replace('<', "[");
    format!("{head}frames: vec![{frames}], output{rest}")
}

/// The first models of a seed.
pub fn recipes(seed: u64, count: usize) -> Vec<Recipe> {
    let mut runner = runner(seed, 0);
    (0..count).map(|_| strategy::recipe().new_tree(&mut runner).unwrap().current()).collect()
}

fn runner(seed: u64, cases: u32) -> TestRunner {
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    let config = Config { cases, failure_persistence: None, max_shrink_iters: 2000, ..Config::default() };
    TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &bytes))
}

/// The state of one thread, which the other threads watch.
#[derive(Default)]
struct Worker {
    /// The recipe being checked, and the time when its check began.
    running: Mutex<Option<(Instant, Recipe)>>,
    /// Number of models that were solved, moved, nearly folded, fell back.
    seen: [AtomicU64; 4],
}

impl Worker {
    /// Draws a batch and checks it. Returns the first failure, shrunk.
    fn batch(&self, seed: u64, cases: u64, device: Option<&Device>) -> Option<String> {
        let result = runner(seed, cases as u32).run(&strategy::recipe(), |recipe| {
            *self.running.lock().unwrap() = Some((Instant::now(), recipe.clone()));
            let Seen { solved, moved, crushed, fell_back } = check::check(&recipe, device);
            for (count, seen) in self.seen.iter().zip([solved, moved, crushed, fell_back]) {
                count.fetch_add(u64::from(seen), Ordering::Relaxed);
            }
            Ok(())
        });
        *self.running.lock().unwrap() = None;
        match result {
            Ok(()) => None,
            Err(TestError::Fail(why, recipe)) => {
                Some(format!("seed {seed}: {why}\n    {}", as_rust(&recipe)))
            }
            Err(TestError::Abort(why)) => Some(format!("seed {seed}: {why}")),
        }
    }

    /// Aborts the program, naming the model, if a solve hangs: its thread cannot be ended.
    fn end_a_hang(&self) {
        if let Some((since, recipe)) = &*self.running.lock().unwrap()
            && since.elapsed() > HANG
        {
            eprintln!("still running after {HANG:?}: {}", as_rust(recipe));
            std::process::abort();
        }
    }
}

/// Checks `cases` models on all cores.
fn check_all(cases: u64, seed: u64, device: Option<&Device>) {
    let start = Instant::now();
    let cores = thread::available_parallelism().map_or(1, |n| n.get());
    // A GPU runs one solve at a time.
    let threads = if device.is_some() { 1 } else { cores };
    let workers: Vec<Worker> = (0..threads).map(|_| Worker::default()).collect();
    let (next, failed) = (AtomicU64::new(0), Mutex::new(Vec::new()));
    let work = |worker: &Worker| {
        loop {
            let k = next.fetch_add(1, Ordering::Relaxed);
            if k * BATCH >= cases {
                return;
            }
            if let Some(failure) = worker.batch(seed + k, BATCH.min(cases - k * BATCH), device) {
                eprintln!("{failure}");
                failed.lock().unwrap().push(failure);
            }
        }
    };
    thread::scope(|scope| {
        let threads: Vec<_> = workers.iter().map(|worker| scope.spawn(|| work(worker))).collect();
        while threads.iter().any(|thread| !thread.is_finished()) {
            thread::sleep(Duration::from_millis(20));
            workers.iter().for_each(Worker::end_a_hang);
        }
    });
    let count = |k: usize| workers.iter().map(|w| w.seen[k].load(Ordering::Relaxed)).sum::<u64>();
    let [solved, moved, crushed, fell_back] = [0, 1, 2, 3].map(count);
    println!(
        "{cases} models in {:.1} s: {solved} solved, {moved} moved, {crushed} crushed, {fell_back} fell back",
        start.elapsed().as_secs_f32()
    );
    let failed = failed.into_inner().unwrap();
    assert!(failed.is_empty(), "{} batches failed:\n{}", failed.len(), failed.join("\n"));
    // Models that are at rest or fixed test little. On a GPU there are only 20 of them.
    assert!(4 * moved > cases, "only {moved} of {cases} models moved");
}

#[test]
fn random_models_end_in_certified_results() {
    let (cases, seed) = plan(CASES, 1);
    check_all(cases, seed, None);
}

#[test]
fn random_models_end_in_certified_results_on_a_gpu() {
    let Some(device) = gpu(&DeviceSettings::default()) else { return };
    let (cases, seed) = plan(GPU_CASES, CASES / GPU_CASES);
    check_all(cases, seed, Some(&device));
}

vrtm_testkit::on_both! {
    what_once_failed_holds(),
    what_once_failed_holds_on_a_gpu(): named_cases_hold
}

fn named_cases_hold(device: &Device) {
    for (name, recipe) in named::cases() {
        println!("{name}");
        // On a CPU a recipe has its own number of threads.
        check::check(&recipe, Some(device).filter(|device| device.info().backend == Backend::Gpu));
    }
}
