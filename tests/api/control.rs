//! A call that is under way: cancelled anywhere, told about, read beside, and run on a host's threads.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use vrtm::{
    Asset, Control, Device, DeviceSettings, ErrorKind, Executor, FetchKind, PbdSettings, Quality, Result,
    SolveOptions, SolveRequest, Solver,
};
use vrtm_testkit::{self, Model, bits, corner_uvs, fetch, long, options, scenes, texels};

/// Solves a frame under a control.
fn solve(
    asset: &mut Asset,
    model: &Model,
    frame: usize,
    options: SolveOptions,
    control: &Arc<Control>,
) -> Result<()> {
    let control = Some(control.clone());
    asset
        .run(&SolveRequest { positions: model.frame(frame), options, control, ..Default::default() }, &mut [])
}

/// The ways of solving that differ in what they keep in memory.
fn ways() -> Vec<SolveOptions> {
    let pbd = PbdSettings { iterations: 8, ..PbdSettings::default() };
    vec![
        options(Quality::Normal),
        SolveOptions { max_corrections: Some(7), ..SolveOptions::default() },
        options(Quality::Draft),
        SolveOptions { warm: true, temporal_weight: 0.1, ..SolveOptions::default() },
        SolveOptions { solver: Solver::Pbd, pbd, ..SolveOptions::default() },
    ]
}

/// Cancels solves before each of many items of their work. What was there before stays, and the next solve gives what
/// it gives without any cancelled one. Returns how many were cancelled.
fn cancel_everywhere(model: &Model, points: u64, make: impl Fn() -> Asset) -> usize {
    let mut cancelled = 0;
    for options in ways() {
        let cold = SolveOptions { warm: false, temporal_weight: 0.0, ..options };
        let mut fresh = make();
        fresh.solve(model.frame(1), &cold).unwrap();
        let first = bits(&fresh);
        fresh.solve(model.frame(2), &options).unwrap();
        let second = bits(&fresh);
        assert!(first != second);

        // The number of items of a whole solve, by doubling.
        let mut asset = make();
        asset.solve(model.frame(1), &cold).unwrap();
        let mut items = 1u64;
        loop {
            let control = Arc::new(Control::new());
            control.cancel_at_item(items);
            match solve(&mut asset, model, 2, options, &control) {
                Err(error) => assert_eq!(error.kind, ErrorKind::Cancelled),
                Ok(()) => break,
            }
            assert!(bits(&asset) == first, "{options:?} at item {items}");
            items *= 2;
        }
        for k in 0..points {
            asset.solve(model.frame(1), &cold).unwrap();
            assert!(bits(&asset) == first, "{options:?}: after {k} of {points}");
            let control = Arc::new(Control::new());
            // Denser at the beginning, where work that is done once per solve lies.
            control.cancel_at_item(1 + items * k * k / (points * points));
            let outcome = solve(&mut asset, model, 2, options, &control);
            let Err(error) = outcome else { continue };
            assert_eq!(error.kind, ErrorKind::Cancelled);
            assert!(control.is_cancelled());
            assert!(bits(&asset) == first, "{options:?}: {k} of {points}");
            assert!(!asset.tile(0).report().unwrap().kept);
            cancelled += 1;
            asset.solve(model.frame(2), &options).unwrap();
            assert!(bits(&asset) == second, "{options:?}: after {k} of {points}");
        }
    }
    cancelled
}

#[test]
fn a_solve_can_be_cancelled_anywhere() {
    let model = Model::from(scenes::by_name("mug_to_jug").unwrap());
    let points = long::cases(40, 16, "moments of a solve");
    for threads in [1, 2] {
        let cancelled = cancel_everywhere(&model, points, || model.asset(threads, 96));
        println!("{threads} threads: {cancelled} solves cancelled");
        assert!(2 * cancelled as u64 > 5 * points);
    }
}

/// Several tiles, some of which are solved side by side.
#[test]
fn a_solve_of_several_tiles_can_be_cancelled_anywhere() {
    let model = Model::from(scenes::by_name("arm").unwrap());
    let cancelled = cancel_everywhere(&model, 16, || model.asset(2, 64));
    assert!(cancelled > 40, "{cancelled}");
}

#[test]
fn a_solve_on_a_gpu_can_be_cancelled_anywhere() {
    let Some(device) = vrtm_testkit::gpu(&DeviceSettings::default()) else { return };
    let model = Model::from(scenes::by_name("mug_to_jug").unwrap());
    let points = long::cases(12, 3, "moments of a solve");
    let cancelled = cancel_everywhere(&model, points, || model.asset_on(&device, 64));
    println!("{cancelled} solves cancelled");
    assert!(3 * cancelled as u64 > 5 * points);
}

#[test]
fn a_first_solve_that_is_cancelled_leaves_no_result() {
    let model = Model::from(scenes::by_name("mug_to_jug").unwrap());
    let mut asset = model.asset(2, 64);
    let control = Arc::new(Control::new());
    control.cancel();
    let error = solve(&mut asset, &model, 1, SolveOptions::default(), &control).unwrap_err();
    assert_eq!((error.kind, asset.report().unwrap_err().kind), (ErrorKind::Cancelled, ErrorKind::NotSolved));
    asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
    let fresh = model.solved(&vrtm_testkit::cpu(2), 64, 1, &SolveOptions::default());
    assert!(bits(&asset) == bits(&fresh));
}

/// The progress that a host is told grows from 0 to nearly 1, in steps, and the bits are those without a control.
#[test]
fn progress_is_told_and_changes_nothing() {
    let model = Model::from(scenes::by_name("mug_to_jug").unwrap());
    for options in ways() {
        let plain = model.solved(&vrtm_testkit::cpu(2), 512, 1, &options);
        let mut asset = model.asset(2, 512);
        let told = Arc::new(Mutex::new(Vec::new()));
        let (list, of_list) = (told.clone(), told.clone());
        let control = Arc::new(Control::with_progress(Arc::new(move |progress| {
            list.lock().unwrap().push(progress);
            false
        })));
        solve(&mut asset, &model, 1, options, &control).unwrap();
        assert!(bits(&asset) == bits(&plain));
        let told = told.lock().unwrap();
        assert!(told.windows(2).all(|pair| pair[0] <= pair[1]), "{told:?}");
        assert!(told.iter().all(|progress| (0.0..=1.0).contains(progress)));
        assert_eq!(control.progress(), 1.0);
        let mut steps = told.clone();
        steps.dedup();
        let largest = told.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f32::max);
        println!(
            "{:?}: told {} times, {} values, largest step {largest:.2}",
            options.quality,
            told.len(),
            steps.len()
        );
        assert!(steps.len() >= 4, "{told:?}");
        assert_eq!(*told.last().unwrap(), 1.0);
        // A call that has nothing to do tells its end, too.
        let before = told.len();
        drop(told);
        solve(&mut asset, &model, 1, options, &control).unwrap();
        let told = of_list.lock().unwrap();
        assert!(told.len() > before && *told.last().unwrap() == 1.0, "{:?}", &told[before..]);
    }
}

/// The function that is told the progress may read results, and its answer cancels.
#[test]
fn a_progress_function_reads_results_and_cancels() {
    let model = Model::from(scenes::by_name("mug_to_jug").unwrap());
    let mut asset = model.solved(&vrtm_testkit::cpu(2), 256, 1, &SolveOptions::default());
    let first = bits(&asset);
    let (results, calls) = (asset.results().clone(), Arc::new(AtomicUsize::new(0)));
    let counter = calls.clone();
    let control = Arc::new(Control::with_progress(Arc::new(move |_| {
        assert!(results.report().unwrap().min_jacobian > 0.0);
        counter.fetch_add(1, Ordering::Relaxed) == 2
    })));
    let error = solve(&mut asset, &model, 2, SolveOptions::default(), &control).unwrap_err();
    assert_eq!((error.kind, calls.load(Ordering::Relaxed)), (ErrorKind::Cancelled, 3));
    assert!(bits(&asset) == first);
}

/// Reads everything that can be read, again and again, while other frames are solved. Each map is that of one frame.
fn read_while_solving(device: &Device, grid: u32) {
    const SIZE: u32 = 96;
    let model = Model::from(scenes::mug_to_jug());
    let mut asset = model.asset_on(device, grid);
    let map = |asset: &mut Asset| fetch(asset, 0, FetchKind::Redirection, [SIZE, SIZE]);
    let frames = [1, 2];
    let mut maps = Vec::new();
    for frame in frames {
        asset.solve(model.frame(frame), &SolveOptions::default()).unwrap();
        maps.push(map(&mut asset));
    }
    assert!(maps[0] != maps[1]);
    let (results, over) = (asset.results().clone(), AtomicBool::new(false));
    let (corners, reads) = (asset.info().corners as usize, AtomicUsize::new(0));
    let read = || {
        let mut seen = [0; 2];
        while !over.load(Ordering::Relaxed) {
            let read = texels(&results, 0, FetchKind::Redirection, [SIZE; 2], [f32::NAN; 2]);
            let which = maps.iter().position(|map| *map == read).expect("a map of one of the frames, whole");
            seen[which] += 1;
            results.corner_uvs(0, &mut vec![[0.0; 2]; corners]).unwrap();
            assert_eq!(results.tile(0).report().unwrap().folds, 0);
            results.report().unwrap();
            reads.fetch_add(1, Ordering::Relaxed);
        }
        seen
    };
    let seen = std::thread::scope(|scope| {
        let readers = [scope.spawn(read), scope.spawn(read)];
        let mut solves = 0;
        while solves < 8 || reads.load(Ordering::Relaxed) < 16 {
            asset.solve(model.frame(frames[solves % 2]), &SolveOptions::default()).unwrap();
            solves += 1;
        }
        over.store(true, Ordering::Relaxed);
        println!("{solves} solves");
        readers.map(|reader| reader.join().unwrap())
    });
    println!("maps of the two frames that were read: {seen:?}");
    assert!(seen.iter().flatten().sum::<usize>() >= 8);
}

vrtm_testkit::on_both! {
    results_are_read_while_the_next_ones_are_computed(256),
    results_are_read_while_the_next_ones_are_computed_on_a_gpu(64): read_while_solving
}

/// Results outlive their asset.
#[test]
fn results_are_there_as_long_as_someone_holds_them() {
    let model = Model::from(scenes::by_name("mug_to_jug").unwrap());
    let mut asset = model.asset(1, 64);
    let results = asset.results().clone();
    assert_eq!(results.tile(0).report().unwrap_err().kind, ErrorKind::NotSolved);
    asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
    let report = asset.tile(0).report().unwrap();
    drop(asset);
    assert_eq!(results.tile(0).report().unwrap(), report);
}

/// A host's threads of many kinds.
enum Host {
    /// The tasks one after the other, on the calling thread.
    InTurn,
    /// The same, the last one first.
    Backwards,
    /// Each on a thread of its own, none on the calling one.
    Elsewhere,
    /// The first ones late, after the others.
    Late,
    /// None at all, which breaks the host's word and does no harm.
    Lazy,
    /// One more than it was asked for.
    Eager,
}

impl Executor for Host {
    fn parallel_for(&self, count: usize, task: &(dyn Fn(usize) + Sync)) {
        let own_threads = |tasks: &[usize], wait: Duration| {
            std::thread::scope(|scope| {
                for &k in tasks {
                    scope.spawn(move || {
                        if k == 0 {
                            std::thread::sleep(wait);
                        }
                        task(k);
                    });
                }
            });
        };
        let all: Vec<usize> = (0..count).collect();
        match self {
            Host::InTurn => all.iter().for_each(|&k| task(k)),
            Host::Backwards => all.iter().rev().for_each(|&k| task(k)),
            Host::Elsewhere => own_threads(&all, Duration::ZERO),
            Host::Late => own_threads(&all, Duration::from_millis(30)),
            Host::Lazy => {}
            Host::Eager => own_threads(&(0..=count).collect::<Vec<_>>(), Duration::ZERO),
        }
    }
}

#[test]
fn a_host_s_threads_give_the_same_bits() {
    let model = Model::from(scenes::by_name("arm").unwrap());
    let solve = |settings: DeviceSettings| {
        let device = vrtm::Device::new(&settings).unwrap();
        let mut asset = model.solved(&device, 128, 1, &SolveOptions::default());
        let map = fetch(&mut asset, 1, FetchKind::Redirection, [100, 100]);
        let uvs = corner_uvs(&asset);
        (bits(&asset), map, uvs)
    };
    let cpu = |threads, executor| DeviceSettings {
        backend: vrtm::Backend::Cpu,
        threads: std::num::NonZeroU32::new(threads),
        executor,
        ..DeviceSettings::default()
    };
    let own = solve(cpu(2, None));
    for host in [Host::InTurn, Host::Backwards, Host::Elsewhere, Host::Late, Host::Lazy, Host::Eager] {
        let host: Arc<dyn Executor> = Arc::new(host);
        for threads in [1, 2, 5] {
            assert!(own == solve(cpu(threads, Some(host.clone()))));
        }
    }
}

/// Many nodes on a pool of two threads, each of which asks for two: no one waits for a thread that never comes.
#[test]
fn many_nodes_share_a_host_s_two_threads() {
    struct Pool(AtomicUsize);
    impl Executor for Pool {
        fn parallel_for(&self, count: usize, task: &(dyn Fn(usize) + Sync)) {
            self.0.fetch_add(1, Ordering::Relaxed);
            (0..count).for_each(task);
        }
    }
    let pool = Arc::new(Pool(AtomicUsize::new(0)));
    let settings = DeviceSettings {
        backend: vrtm::Backend::Cpu,
        threads: std::num::NonZeroU32::new(2),
        executor: Some(pool.clone()),
        ..DeviceSettings::default()
    };
    let device = vrtm::Device::new(&settings).unwrap();
    let model = Model::from(scenes::by_name("mug_to_jug").unwrap());
    let alone = model.solved(&vrtm_testkit::cpu(1), 64, 1, &SolveOptions::default());
    let wanted = bits(&alone);
    let nodes: Vec<usize> = (0..64).collect();
    let same = vrtm_testkit::on_all_cores(&nodes, |_| {
        let asset = model.solved(&device, 64, 1, &SolveOptions::default());
        bits(&asset) == wanted
    });
    assert!(same.into_iter().all(|same| same));
    assert!(pool.0.load(Ordering::Relaxed) >= 64);
}

#[test]
fn a_number_of_threads_per_solve() {
    let model = Model::from(scenes::by_name("mug_to_jug").unwrap());
    let mut asset = model.asset(1, 128);
    let mut all = Vec::new();
    for threads in [1, 2, 7] {
        let threads = std::num::NonZeroU32::new(threads);
        let request = SolveRequest { positions: model.frame(1), threads, ..SolveRequest::default() };
        asset = model.asset(1, 128);
        asset.run(&request, &mut []).unwrap();
        all.push(bits(&asset));
    }
    assert!(all.windows(2).all(|pair| pair[0] == pair[1]));
    let threads = std::num::NonZeroU32::new(1025);
    let request = SolveRequest { positions: model.frame(1), threads, ..SolveRequest::default() };
    let error = asset.run(&request, &mut []).unwrap_err();
    assert_eq!(error.message, "options.threads: 1025 is over 1024");
}
