//! Preparing a tile: its memory, its estimate, the budget, and strokes that change a part of a map.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ffi::c_void;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::beyond::CutSheet;
use vrtm::{
    Asset, Backend, Device, DeviceSettings, ErrorKind, FetchKind, HostAllocator, ImageLayout, ImageView,
    LogCode, OpenBorders, PixelFormat, Quality, RefinementSettings, SolveOptions, Strided, TileSettings,
};
use vrtm_testkit::log::listened;
use vrtm_testkit::processor::seconds;
use vrtm_testkit::random::Random;
use vrtm_testkit::sixteen::{bulged, discs, sixteen_asset, sixteen_charts};
use vrtm_testkit::{self, change, cpu, fetch, gpu, options, view};

static LIVE: AtomicU64 = AtomicU64::new(0);
static PEAK: AtomicU64 = AtomicU64::new(0);

unsafe extern "C" fn alloc(_: *mut c_void, size: usize, alignment: usize) -> *mut c_void {
    let live = LIVE.fetch_add(size as u64, Ordering::Relaxed) + size as u64;
    PEAK.fetch_max(live, Ordering::Relaxed);
    // SAFETY: the layout is not empty.
    unsafe { System.alloc(Layout::from_size_align(size, alignment).unwrap()).cast() }
}

unsafe extern "C" fn free(_: *mut c_void, pointer: *mut c_void, size: usize, alignment: usize) {
    LIVE.fetch_sub(size as u64, Ordering::Relaxed);
    // SAFETY: from `alloc`, for this layout.
    unsafe { System.dealloc(pointer.cast(), Layout::from_size_align(size, alignment).unwrap()) }
}

/// A CPU device whose memory is counted: the bytes that it takes, and the most of them.
fn counting(memory_budget: Option<u64>) -> Device {
    // SAFETY: the functions are those of the system's allocator.
    let allocator = Some(unsafe { HostAllocator::new(alloc, free, std::ptr::null_mut()) });
    let settings = DeviceSettings { backend: Backend::Cpu, memory_budget, allocator, ..Default::default() };
    Device::new(&settings).unwrap()
}

/// Tests that count memory run one at a time.
static ALONE: Mutex<()> = Mutex::new(());

fn alone() -> std::sync::MutexGuard<'static, ()> {
    ALONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Bytes that devices with counted memory take while `f` runs, at most and when it ends, less those before; and its
/// result.
fn counted<R>(f: impl FnOnce() -> R) -> (u64, u64, R) {
    let before = LIVE.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let result = f();
    let [peak, live] = [&PEAK, &LIVE].map(|x| x.load(Ordering::Relaxed).saturating_sub(before));
    (peak, live, result)
}

/// Sixteen charts that cover a share of the tile, with discs of rigidity, on a grid as large as the map.
fn sixteen(device: &Device, size: u32, share: f64) -> Asset {
    let mut asset = sixteen_asset(device, share).unwrap();
    let texels = discs(size as usize, 32);
    asset.tile_mut(0).set_rigidity(Some(view(&texels, size, size))).unwrap();
    vrtm_testkit::set_grid(&mut asset, size);
    asset
}

#[test]
fn preparing_takes_little_more_than_what_stays() {
    let _alone = alone();
    for (size, share) in [(2048, 0.02), (2048, 0.25), (1024, 1.0)] {
        let device = counting(None);
        let mut asset = sixteen_asset(&device, share).unwrap();
        let texels = discs(size as usize, 32);
        let (_, before, set) = counted(|| asset.tile_mut(0).set_rigidity(Some(view(&texels, size, size))));
        set.unwrap();
        vrtm_testkit::set_grid(&mut asset, size);
        let estimate = asset.tile_mut(0).estimate().unwrap();
        let (peak, live, info) = counted(|| asset.tile_mut(0).info().unwrap());
        let ratio = (before + peak) as f64 / (before + live) as f64;
        println!(
            "{size}², {share}: {} nodes, {:.1} bytes per node, peak {ratio:.3} of what stays; {estimate:?}",
            info.movable_nodes,
            live as f64 / info.movable_nodes as f64
        );
        assert!(ratio <= 1.3, "{size} {share}: {ratio}");
        assert_eq!(estimate.movable_nodes, info.movable_nodes);
        // What lies under the nodes of level 1 is not known before.
        let held = estimate.prepared_bytes as f64 / (before + live) as f64;
        assert!((0.85..1.15).contains(&held), "{size} {share}: {held}");
        assert!(estimate.preparing_bytes as f64 > 0.95 * (before + peak) as f64);
        // The rest pose and the account of the device itself.
        let booked = device.info().bytes_held as f64;
        let (positions, ..) = sixteen_charts(share);
        let pose = bulged(&positions, 0.3);
        let (peak, _, solved) =
            counted(|| asset.solve(Strided::from_slice(&pose), &options(Quality::Normal)));
        solved.unwrap();
        let total = (before + live + peak) as f64;
        let solving = estimate.solving_bytes as f64 / total;
        println!("    solving: {solving:.3} of the peak was estimated; {booked} bytes were booked before");
        assert!((0.85..1.15).contains(&solving), "{size} {share}: {solving}");
    }
}

/// The estimate counts collars and what the blend at seams is found with, and a budget of it suffices.
#[test]
fn what_lies_beyond_borders_is_estimated() {
    let _alone = alone();
    for (charts, size) in [([2, 1], 512), ([4, 4], 512)] {
        let sheet = CutSheet::new(charts, 64 / charts[0]);
        let mut asset = sheet.asset(&counting(None), size, true);
        let (_, collars, estimate) = counted(|| asset.tile_mut(0).estimate().unwrap());
        let pose = sheet.pose(0.3);
        let (peak, _, solved) = counted(|| asset.solve(Strided::from_slice(&pose), &options(Quality::Draft)));
        solved.unwrap();
        let total = (collars + peak) as f64 + f64::from(size as u32).powi(2);
        let share = estimate.solving_bytes as f64 / total;
        println!("{charts:?} {size}²: {share:.3} of the peak was estimated; {estimate:?}");
        assert!((0.85..1.3).contains(&share), "{charts:?} {size}: {share}");
        let device = counting(Some(estimate.solving_bytes));
        sheet.asset(&device, size, true).solve(Strided::from_slice(&pose), &options(Quality::Draft)).unwrap();
        let few = counting(Some(estimate.solving_bytes / 2));
        let mut asset = sheet.asset(&few, size, true);
        let refused = asset.solve(Strided::from_slice(&pose), &options(Quality::Draft)).unwrap_err();
        assert_eq!(refused.kind, ErrorKind::OutOfMemory);
    }
}

/// A refinement takes memory for the part of a grid that moves, not for all of it.
#[test]
fn refining_takes_memory_for_what_moves() {
    let _alone = alone();
    for open_borders in [OpenBorders::Fixed, OpenBorders::Slide] {
        let mut asset = sixteen(&counting(None), 4096, 0.01);
        change(&mut asset, 0, |settings| settings.open_borders = open_borders);
        let (positions, ..) = sixteen_charts(0.01);
        let pose = bulged(&positions, 0.3);
        asset.solve(Strided::from_slice(&pose), &options(Quality::Draft)).unwrap();
        let (peak, _, refined) = counted(|| asset.refine(&RefinementSettings::default()));
        let info = refined.unwrap().info();
        println!("{} MB at most for {} triangles, {open_borders:?}", peak >> 20, info.triangles);
        // Displacements of all nodes alone are 134 MB, and so are the charts that they belong to.
        assert!(info.reached && peak < 40 << 20, "{peak} bytes");
    }
}

/// A measurement holds positions at all nodes: they count, and are free afterwards.
#[test]
fn measuring_is_booked() {
    let _alone = alone();
    let sheet = CutSheet::new([2, 1], 8);
    let pose = sheet.pose(0.3);
    let (size, measured) = (512, SolveOptions { measure: true, ..options(Quality::Draft) });
    let bytes = sheet.asset(&counting(None), size, false).tile_mut(0).estimate().unwrap().solving_bytes;
    let solve = |budget, options: &SolveOptions| {
        let device = counting(Some(budget));
        let mut asset = sheet.asset(&device, size, false);
        let (peak, _, solved) = counted(|| asset.solve(Strided::from_slice(&pose), options));
        (solved.map_err(|error| error.kind), peak)
    };
    let ((plain, without), (all, with)) =
        (solve(bytes, &options(Quality::Draft)), solve(3 * bytes + (64 << 20), &measured));
    assert_eq!([plain, all], [Ok(()); 2]);
    let per_node = (with - without) as f64 / (size * size) as f64;
    println!("{per_node} bytes per node more");
    assert!(per_node < 175.0, "{per_node}");
    assert_eq!(solve(bytes, &measured).0, Err(ErrorKind::OutOfMemory));
}

#[test]
fn memory_is_refused_before_it_is_taken() {
    let _alone = alone();
    let needed = sixteen(&cpu(0), 2048, 0.25).tile_mut(0).estimate().unwrap();
    let budget = |bytes| counting(Some(bytes));
    let mut asset = sixteen(&budget(needed.prepared_bytes / 2), 2048, 0.25);
    let (peak, live, info) = counted(|| asset.tile_mut(0).info());
    assert_eq!(info.unwrap_err().kind, ErrorKind::OutOfMemory);
    assert!(peak < needed.prepared_bytes / 10, "{peak} of {} bytes", needed.prepared_bytes);
    assert_eq!(live, 0);
    // Enough for the grid, but not for a solve.
    let mut asset = sixteen(&budget(needed.prepared_bytes * 3 / 2), 2048, 0.25);
    asset.tile_mut(0).info().unwrap();
    let (positions, ..) = sixteen_charts(0.25);
    let (peak, _, solved) =
        counted(|| asset.solve(Strided::from_slice(&positions), &options(Quality::Draft)));
    // At rest nothing is solved, and nothing is needed.
    solved.unwrap();
    assert!(peak < needed.prepared_bytes, "{peak}");
    let pose = bulged(&positions, 0.3);
    let (peak, _, solved) = counted(|| asset.solve(Strided::from_slice(&pose), &options(Quality::Draft)));
    assert_eq!(solved.unwrap_err().kind, ErrorKind::OutOfMemory);
    assert!(peak < needed.prepared_bytes / 2, "{peak}");
}

#[test]
fn rigid_texels_that_cannot_move_are_told() {
    let _alone = alone();
    let (device, log) = listened();
    let said = || log.take().into_iter().map(|line| line.code).collect::<Vec<_>>();
    let warned = || said().contains(&LogCode::NothingMoves);
    let mut asset = sixteen(&device, 256, 0.5);
    let free = asset.tile_mut(0).info().unwrap();
    // Discs at the charts' borders are cut by them.
    assert!(free.fixed > 0.0 && free.fixed < 0.5, "{}", free.fixed);
    let codes = said();
    assert!(codes.contains(&LogCode::Grid) && !codes.contains(&LogCode::NothingMoves), "{codes:?}");
    // Half of the tile is masked, then all of it.
    let half: Vec<u8> = (0..256 * 256).map(|k| if k % 256 < 128 { 0 } else { 255 }).collect();
    asset.tile_mut(0).set_mask(Some(view(&half, 256, 256))).unwrap();
    let masked = asset.tile_mut(0).info().unwrap();
    assert!((masked.fixed - (0.5 + 0.5 * free.fixed)).abs() < 0.05, "{} {}", masked.fixed, free.fixed);
    assert!(!warned());
    asset.tile_mut(0).set_mask(Some(view(&vec![0; 256 * 256], 256, 256))).unwrap();
    let fixed = asset.tile_mut(0).info().unwrap();
    assert_eq!((fixed.fixed, fixed.movable_nodes), (1.0, 0));
    assert!(warned());
}

#[test]
fn all_memory_goes_back_with_the_asset() {
    let _alone = alone();
    let device = counting(None);
    let (positions, ..) = sixteen_charts(0.25);
    let pose = bulged(&positions, 0.3);
    let (peak, live, ()) = counted(|| {
        for size in [256, 512] {
            let mut asset = sixteen(&device, size, 0.25);
            asset.solve(Strided::from_slice(&pose), &options(Quality::Normal)).unwrap();
            fetch(&mut asset, 0, FetchKind::Redirection, [size; 2]);
        }
    });
    assert!(peak > 1_000_000, "{peak} bytes were counted");
    assert_eq!(live, 0, "bytes are still allocated");
    assert_eq!(device.info().bytes_held, 0);
}

/// Everything of an asset's result that a host can see, but for times.
fn seen(asset: &mut Asset, pose: &[[f32; 3]]) -> (Vec<[u32; 2]>, [f64; 4], [u64; 4], [u32; 3]) {
    asset.solve(Strided::from_slice(pose), &options(Quality::Normal)).unwrap();
    let report = asset.tile(0).report().unwrap();
    let info = asset.tile_mut(0).info().unwrap();
    let warp = fetch(asset, 0, FetchKind::Warp, report.grid.map(|n| n + 1));
    (
        warp.iter().map(|uv| uv.map(f32::to_bits)).collect(),
        [report.energy_before, report.energy, report.min_jacobian, info.fixed.into()],
        [report.folds, report.blocks, info.movable_nodes, u64::from(report.levels)],
        [report.charts, report.charts_fallback, report.charts_identity],
    )
}

/// Strokes at random places, each compared with an asset that gets the changed map as a new one.
fn strokes(device: &Device, sizes: &[([u32; 2], [u32; 2])], rounds: u32, format: PixelFormat) {
    let (positions, ..) = sixteen_charts(0.6);
    let pose = bulged(&positions, 0.4);
    let mut random = Random(7);
    for &(map, grid) in sizes {
        let make = |values: &[f32]| {
            let mut asset = sixteen(device, 64, 0.6);
            let settings = TileSettings { grid: grid.map(Some), ..TileSettings::default() };
            asset.tile_mut(0).set_settings(&settings).unwrap();
            let bytes = encoded(values, format);
            let layout = ImageLayout::packed(map[0], map[1], format);
            let image = ImageView::new("rigidity", &bytes, layout).unwrap();
            asset.tile_mut(0).set_rigidity(Some(image)).unwrap();
            asset
        };
        let mut values = vec![0.0f32; (map[0] * map[1]) as usize];
        // One chart has no rigidity at first.
        for (n, value) in values.iter_mut().enumerate() {
            let (x, y) = (n as u32 % map[0], n as u32 / map[0]);
            if x > map[0] / 4 || y > map[1] / 4 {
                *value = f32::from(u8::from(x / 5 % 3 == 0 && y / 4 % 3 == 0));
            }
        }
        let mut asset = make(&values);
        let first = seen(&mut asset, &pose);
        assert!(first.1[1] < first.1[0], "something is solved");
        let mut changed = 0;
        for round in 0..rounds {
            let mut below = |n: u32| random.below(n as usize) as u32;
            let size = [1 + below(12), 1 + below(12)];
            let mut at = [0, 1].map(|axis| below(map[axis] - size[axis] + 1));
            if round == 0 {
                at = map.map(|n| n / 8);
            }
            let value = random.one(&[0.0, 1.0, 0.5]);
            for y in at[1]..at[1] + size[1] {
                for x in at[0]..at[0] + size[0] {
                    values[(y * map[0] + x) as usize] = value;
                }
            }
            let bytes = encoded(&values, format);
            let image =
                ImageView::new("rigidity", &bytes, ImageLayout::packed(map[0], map[1], format)).unwrap();
            asset.tile_mut(0).update_rigidity(image, at, size).unwrap();
            let (stroked, fresh) = (seen(&mut asset, &pose), seen(&mut make(&values), &pose));
            assert!(
                stroked == fresh,
                "{map:?} {grid:?}: round {round}, {size:?} texels at {at:?} of {value}"
            );
            changed += u32::from(stroked != first);
        }
        assert!(changed > 0);
    }
}

fn encoded(values: &[f32], format: PixelFormat) -> Vec<u8> {
    match format {
        PixelFormat::U8 => values.iter().map(|x| (x * 255.0) as u8).collect(),
        _ => values.iter().flat_map(|x| x.to_ne_bytes()).collect(),
    }
}

#[test]
fn a_stroke_gives_what_a_new_map_gives() {
    let _alone = alone();
    // Maps as large as the grid, finer and coarser, and not square.
    strokes(&cpu(0), &[([128, 128], [128, 128]), ([300, 200], [128, 96])], 12, PixelFormat::U8);
    strokes(&cpu(0), &[([60, 80], [192, 256])], 8, PixelFormat::F32);
}

#[test]
fn a_stroke_gives_what_a_new_map_gives_on_a_gpu() {
    let _alone = alone();
    if let Some(device) = gpu(&DeviceSettings::default()) {
        strokes(&device, &[([64, 64], [64, 64])], 3, PixelFormat::U8);
    }
}

#[test]
fn a_stroke_takes_a_small_part_of_preparing() {
    let _alone = alone();
    let size = 2048;
    let device = cpu(1);
    let mut texels = discs(size, 32);
    let (mut preparing, mut stroking) = (f64::MAX, f64::MAX);
    for round in 0..3 {
        let mut asset = sixteen(&device, size as u32, 1.0);
        preparing = preparing.min(seconds(|| asset.tile_mut(0).info().unwrap()).0);
        let at = [700 + 40 * round, 600];
        for y in at[1]..at[1] + 10 {
            texels[y * size + at[0]..][..10].fill(200);
        }
        let stroke = || {
            let image = view(&texels, size as u32, size as u32);
            asset.tile_mut(0).update_rigidity(image, at.map(|x| x as u32), [10, 10]).unwrap();
            asset.tile_mut(0).info().unwrap();
        };
        stroking = stroking.min(seconds(stroke).0);
    }
    let share = stroking / preparing;
    println!("preparing {preparing:.3} s, a stroke {stroking:.4} s: {:.2} %", 100.0 * share);
    // About 4 %, of which finding the features of the whole tile is a part.
    assert!(share <= 0.08, "{share}");
}

/// Pages of a map that no chart comes near to are not held, and what is on them has no effect on any grid.
#[test]
fn what_is_painted_beside_charts_has_no_effect() {
    let device = cpu(0);
    let (positions, uvs, _) = sixteen_charts(0.1);
    let pose = bulged(&positions, 0.4);
    let n = 512;
    // Half a cell of the coarsest grid, and a texel, may be read beside a chart.
    let reach = 0.5 / 16.0 + 1.5 / n as f32;
    let boxes: Vec<[[f32; 2]; 2]> = uvs
        .chunks_exact(uvs.len() / 16)
        .map(|chart| {
            let bound =
                |f: fn(f32, f32) -> f32| [0, 1].map(|k| chart.iter().map(|uv| uv[k]).reduce(f).unwrap());
            [bound(f32::min).map(|x| x - reach), bound(f32::max).map(|x| x + reach)]
        })
        .collect();
    let is_beside = |k: usize| {
        let at = [k % n, n - 1 - k / n].map(|x| (x as f32 + 0.5) / n as f32);
        !boxes.iter().any(|[low, high]| (0..2).all(|axis| (low[axis]..high[axis]).contains(&at[axis])))
    };
    let clean = discs(n, 24);
    let painted: Vec<u8> = (0..n * n).map(|k| if is_beside(k) { 255 - clean[k] } else { clean[k] }).collect();
    assert!(painted != clean);
    for grid in [16, 48, 512] {
        let [mut a, mut b] = [&clean, &painted].map(|texels| {
            let mut asset = sixteen_asset(&device, 0.1).unwrap();
            asset.tile_mut(0).set_rigidity(Some(view(texels, n as u32, n as u32))).unwrap();
            vrtm_testkit::set_grid(&mut asset, grid);
            asset
        });
        assert!(seen(&mut a, &pose) == seen(&mut b, &pose), "{grid}");
    }
    let held = |share| sixteen(&cpu(1), 1024, share).tile_mut(0).estimate().unwrap();
    let (sparse, full) = (held(0.02), held(1.0));
    // Sixteen small charts with their surroundings.
    assert!(full.prepared_bytes > 4 * sparse.prepared_bytes, "{sparse:?} {full:?}");
}

#[test]
fn a_stroke_needs_a_map_of_its_shape() {
    let device = cpu(1);
    let mut asset = sixteen(&device, 64, 0.5);
    let bytes = vec![0; 64 * 64 * 4];
    let image = |width, height, format| {
        ImageView::new("rigidity", &bytes, ImageLayout::packed(width, height, format)).unwrap()
    };
    let mut message = |view, at, size| asset.tile_mut(0).update_rigidity(view, at, size).unwrap_err().message;
    for (view, at, size) in [
        (image(32, 64, PixelFormat::U8), [0, 0], [4, 4]),
        (image(64, 64, PixelFormat::F32), [0, 0], [4, 4]),
        (image(64, 64, PixelFormat::U8), [60, 0], [5, 4]),
        (image(64, 64, PixelFormat::U8), [0, u32::MAX], [4, 4]),
        (image(64, 64, PixelFormat::U8), [0, 0], [0, 4]),
    ] {
        let text = message(view, at, size);
        assert!(text.starts_with("rigidity: "), "{text}");
    }
    asset.tile_mut(0).set_rigidity(None).unwrap();
    let error =
        asset.tile_mut(0).update_rigidity(image(64, 64, PixelFormat::U8), [0, 0], [4, 4]).unwrap_err();
    let text = error.message;
    assert!(text.contains("no map"), "{text}");
}
