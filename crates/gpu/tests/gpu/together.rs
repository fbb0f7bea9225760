//! Tiles that a GPU solves together: each has the bits that it has alone, whatever was solved together before, and all
//! take the dispatches of one.

use std::sync::Arc;
use std::time::Duration;

use vrtm::{
    Asset, Backend, Control, Device, DeviceSettings, ErrorKind, FetchKind, GpuWork, Quality, SolveOptions,
    SolveRequest, Solver, Strided,
};
use vrtm_testkit::Lab as _;
use vrtm_testkit::features::dense::dense;
use vrtm_testkit::{Maps, Model, change, fetch, gpu, options, quads, set_grid, view};

/// Quads on a side of a sheet, and texels on a side of a map.
const QUADS: usize = 6;
const SIZE: usize = 64;
const TILES: usize = 4;
const FRAMES: usize = 4;

/// A sheet in each of four tiles. They bend and stretch, each in its own way; the last one stays as it is in the first
/// pose.
fn model() -> Model {
    let mut model = Model { frames: vec![Vec::new(); FRAMES], ..Model::default() };
    for tile in 0..TILES {
        model.indices.extend(quads([QUADS; 2], model.rest.len()));
        for k in 0..(QUADS + 1).pow(2) {
            let [x, y] = [k % (QUADS + 1), k / (QUADS + 1)].map(|k| k as f32 / QUADS as f32);
            let along = 2.0 * tile as f32 + x;
            model.rest.push([along, y, 0.0]);
            model.uvs.push([tile as f32 + 0.1 + 0.8 * x, 0.1 + 0.8 * y]);
            for (n, frame) in model.frames.iter_mut().enumerate() {
                let bend = if tile == TILES - 1 && n == 0 { 0.0 } else { 0.1 * (n + tile + 1) as f32 };
                frame.push([
                    along + bend * x * x,
                    y * (1.0 + bend * (3.0 * x).sin()),
                    bend * (2.0 * x).cos(),
                ]);
            }
        }
        let [width, height] = [SIZE as u32; 2];
        let rigidity = painted(10 + tile);
        model.maps.push(Maps { udim: 1001 + tile as u32, width, height, rigidity, mask: None });
    }
    model.uv_indices = model.indices.clone();
    model.face_counts = vec![4; model.indices.len() / 4];
    model
}

/// A GPU, if there is one, and the model.
fn set_up() -> Option<(Device, Model)> {
    Some((gpu(&DeviceSettings::default())?, model()))
}

fn painted(pitch: usize) -> Vec<u8> {
    let is_in = |k: usize| [k % SIZE, k / SIZE].iter().all(|x| x % pitch < pitch / 2);
    (0..SIZE * SIZE).map(|k| if is_in(k) { 255 } else { 0 }).collect()
}

fn result(asset: &mut Asset, tile: usize) -> Vec<[u32; 2]> {
    let fetched = fetch(asset, tile, FetchKind::Redirection, [SIZE as u32; 2]);
    let all = asset.displacements(tile).unwrap().into_iter().chain(fetched);
    all.map(|u| u.map(f32::to_bits)).collect()
}

/// The same asset once for all tiles, and once for each of them, of which the others are never solved.
struct Both {
    all: Asset,
    each: Vec<Asset>,
}

impl Both {
    fn new(device: &Device, model: &Model) -> Both {
        let asset = || model.asset_on(device, SIZE as u32);
        Both { all: asset(), each: (0..TILES).map(|_| asset()).collect() }
    }

    fn set(&mut self, set: impl Fn(&mut Asset)) {
        self.each.iter_mut().chain([&mut self.all]).for_each(set);
    }

    /// Solves some tiles in a pose, and compares all that have a result.
    fn solve(&mut self, pose: Strided, tiles: &[usize], options: SolveOptions) {
        let request = SolveRequest { positions: pose, options, tiles: Some(tiles), ..Default::default() };
        self.all.run(&request, &mut []).unwrap();
        for &tile in tiles {
            self.each[tile].run(&SolveRequest { tiles: Some(&[tile]), ..request.clone() }, &mut []).unwrap();
        }
        for (tile, asset) in self.each.iter_mut().enumerate() {
            let alone = asset.tile(tile).report().ok();
            let report = self.all.tile(tile).report().ok();
            let of =
                |report: vrtm::TileReport| (report.energy, report.charts_active, report.max_displacement);
            assert_eq!(report.map(of), alone.map(of), "tile {tile} of {tiles:?}");
            if alone.is_some() {
                assert!(result(&mut self.all, tile) == result(asset, tile), "tile {tile} of {tiles:?}");
            }
        }
    }
}

#[test]
fn tiles_together_have_the_bits_of_each_alone() {
    let Some(device) = gpu(&DeviceSettings::default()) else { return };
    // Where features come out worse, joined ones have their own multipliers.
    let (model, crowded) = (model(), dense(&model()));
    let draft = options(Quality::Draft);
    let pbd = SolveOptions { solver: Solver::Pbd, ..SolveOptions::default() };
    let normal = SolveOptions::default();
    for (model, grid, options) in
        [(&model, 64, normal), (&model, 64, draft), (&model, 64, pbd), (&crowded, 128, normal)]
    {
        let mut both = Both::new(&device, model);
        both.set(|asset| set_grid(asset, grid));
        both.solve(model.frame(2), &[0, 1, 2, 3], options);
        assert!(both.all.displacements(0).unwrap().iter().any(|u| u[0].abs() > 0.1));
    }
}

/// All tiles take the dispatches of the one that takes most: further corrections differ between them.
#[test]
fn tiles_together_take_the_dispatches_of_one() {
    let Some((device, model)) = set_up() else { return };
    let mut both = Both::new(&device, &model);
    both.solve(model.frame(2), &[0, 1, 2, 3], SolveOptions::default());
    let work = |asset: &Asset, tile: usize| asset.tile(tile).gpu_work().unwrap().unwrap();
    let alone: Vec<_> = (0..TILES).map(|tile| work(&both.each[tile], tile)).collect();
    let most = |count: fn(&GpuWork) -> u64| alone.iter().map(count).max().unwrap();
    let workgroups = |work: &GpuWork| work.kernels.iter().map(|kernel| kernel.workgroups).sum::<u64>();
    let all = work(&both.all, 0);
    println!(
        "{} dispatches, {} workgroups; alone {}",
        all.dispatches(),
        workgroups(&all),
        most(GpuWork::dispatches)
    );
    assert!(all.dispatches() <= most(GpuWork::dispatches));
    assert!(all.submissions <= most(|work| work.submissions));
    // Each of the tiles reports them.
    assert!(workgroups(&all) > 2 * alone.iter().map(workgroups).max().unwrap());
    assert_eq!(work(&both.all, 3).dispatches(), all.dispatches());
}

/// Tiles that are solved together differ from call to call, and so do the results that solves start from.
#[test]
fn histories_leave_no_trace() {
    let Some((device, model)) = set_up() else { return };
    let mut both = Both::new(&device, &model);
    let warm = SolveOptions { warm: true, temporal_weight: 0.1, ..SolveOptions::default() };
    let draft = SolveOptions { quality: Quality::Draft, ..warm };
    both.solve(model.frame(1), &[0, 1], warm);
    // The third tile has no result to start from, and the fourth does not move.
    both.solve(model.frame(1), &[0, 1, 2, 3], warm);
    both.solve(model.frame(2), &[1, 3], warm);
    both.solve(model.frame(3), &[0, 1, 2, 3], warm);
    // The last results lie in two buffers of the same solver.
    both.solve(model.frame(4), &[1, 2], warm);
    both.solve(model.frame(2), &[0, 1, 2, 3], warm);
    // A stroke: one tile alone, with the solver of all.
    let held = device.info().bytes_held;
    let painted = painted(14);
    for asset in [&mut both.all, &mut both.each[1]] {
        let image = view(&painted, SIZE as u32, SIZE as u32);
        asset.tile_mut(1).update_rigidity(image, [0; 2], [SIZE as u32; 2]).unwrap();
    }
    both.solve(model.frame(3), &[0, 1, 2, 3], SolveOptions::default());
    both.solve(model.frame(3), &[0, 1, 2, 3], SolveOptions::default());
    assert_eq!(both.all.tile(1).report().unwrap().charts_reused, 1);
    assert!(device.info().bytes_held <= held);
    both.solve(model.frame(4), &[0, 1, 2, 3], draft);
    // Another grid for one of them, and other weights for another.
    both.set(|asset| {
        change(asset, 0, |settings| settings.grid = [Some(32); 2]);
        change(asset, 2, |settings| settings.smoothness = 0.05);
    });
    both.solve(model.frame(2), &[0, 1, 2, 3], warm);
    both.set(|asset| {
        let settings = asset.tile_mut(1).settings().unwrap();
        (0..TILES).for_each(|tile| asset.tile_mut(tile).set_settings(&settings).unwrap());
    });
    both.solve(model.frame(3), &[2, 3], warm);
    both.solve(model.frame(4), &[0, 1, 2, 3], warm);
}

/// Bytes that are booked for an asset once its tiles are solved one by one, and together.
#[test]
fn without_memory_for_all_tiles_each_is_solved_alone() {
    let Some((device, model)) = set_up() else { return };
    let mut both = Both::new(&device, &model);
    let apart = {
        let before = device.info().bytes_held;
        let mut asset = model.asset_on(&device, SIZE as u32);
        for tile in 0..TILES {
            let tiles = Some(&[tile][..]);
            asset
                .run(&SolveRequest { positions: model.frame(2), tiles, ..Default::default() }, &mut [])
                .unwrap();
        }
        let image = (SIZE * SIZE * 24) as u64;
        device.info().bytes_held - before + image
    };
    both.solve(model.frame(2), &[0, 1, 2, 3], SolveOptions::default());
    let settings =
        DeviceSettings { backend: Backend::Gpu, memory_budget: Some(apart), ..DeviceSettings::default() };
    let narrow = Device::new(&settings).unwrap();
    let mut asset = model.asset_on(&narrow, SIZE as u32);
    for _ in 0..2 {
        asset.solve(model.frame(2), &SolveOptions::default()).unwrap();
        for tile in 0..TILES {
            assert!(result(&mut asset, tile) == result(&mut both.all, tile), "tile {tile}");
        }
        assert!(narrow.info().bytes_held <= apart);
    }
    let settings = DeviceSettings { memory_budget: Some(apart / 2), ..settings };
    let mut asset = model.asset_on(&Device::new(&settings).unwrap(), SIZE as u32);
    let error = asset.solve(model.frame(2), &SolveOptions::default()).unwrap_err();
    assert_eq!(error.kind, ErrorKind::OutOfMemory, "{error}");
}

/// With time enough a budget changes nothing; with none, all tiles end early.
#[test]
fn a_time_budget_is_that_of_all_tiles() {
    let Some((device, model)) = set_up() else { return };
    let solve = |budget| {
        let mut asset = model.asset_on(&device, SIZE as u32);
        let options = SolveOptions { time_budget: budget, ..SolveOptions::default() };
        asset.solve(model.frame(2), &options).unwrap();
        let dispatches = asset.tile(0).gpu_work().unwrap().map(|work| work.dispatches());
        let truncated = (0..TILES).map(|tile| asset.tile(tile).report().unwrap().truncated);
        let truncated: Vec<bool> = truncated.collect();
        (truncated, dispatches, (0..TILES).map(|tile| result(&mut asset, tile)).collect::<Vec<_>>())
    };
    let whole = solve(None);
    assert!(whole.0 == [false; TILES] && solve(Some(Duration::from_secs(3600))) == whole);
    let (truncated, _, results) = solve(Some(Duration::from_nanos(1)));
    assert!(truncated == [true; TILES] && results != whole.2);
}

/// A call that is cancelled once its tiles are being solved leaves the results before it, and a solver that can be
/// used.
#[test]
fn a_cancelled_call_changes_nothing() {
    let Some((device, model)) = set_up() else { return };
    let mut both = Both::new(&device, &model);
    both.solve(model.frame(2), &[0, 1, 2, 3], SolveOptions::default());
    let before: Vec<_> = (0..TILES).map(|tile| result(&mut both.all, tile)).collect();
    let control = Arc::new(Control::with_progress(Arc::new(|fraction| fraction > 0.3)));
    let request =
        SolveRequest { positions: model.frame(3), control: Some(control), ..SolveRequest::default() };
    // A GPU that is quick enough is done before it is asked for the first time.
    if let Err(error) = both.all.run(&request, &mut []) {
        assert_eq!(error.kind, ErrorKind::Cancelled, "{error}");
        assert!((0..TILES).all(|tile| result(&mut both.all, tile) == before[tile]));
    }
    both.solve(model.frame(4), &[0, 1, 2, 3], SolveOptions::default());
}

/// Buffers that hold two of the tiles, as on a device with small bindings: two are solved together, and two others.
#[test]
fn tiles_are_solved_together_as_far_as_a_buffer_holds_them() {
    let Some((device, model)) = set_up() else { return };
    let mut whole = model.asset_on(&device, SIZE as u32);
    let settings = DeviceSettings { backend: Backend::Gpu, ..DeviceSettings::default() };
    // A tile has up to 25 blocks.
    let small = Device::with_variables(&settings, &[], Some(55)).unwrap();
    let mut divided = model.asset_on(&small, SIZE as u32);
    for frame in [2, 3] {
        for asset in [&mut whole, &mut divided] {
            asset.solve(model.frame(frame), &SolveOptions { warm: true, ..SolveOptions::default() }).unwrap();
        }
        for tile in 0..TILES {
            assert!(result(&mut whole, tile) == result(&mut divided, tile), "tile {tile}");
        }
    }
    let blocks = |asset: &Asset| asset.tile(0).report().unwrap().blocks;
    assert!(2 * blocks(&whole) <= 55 && 3 * blocks(&whole) > 55, "{}", blocks(&whole));
}
