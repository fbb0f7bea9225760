//! Charts that go on beyond their borders: what is bounded, booked, reused, and can be cancelled.

use std::sync::Arc;

use vrtm::{
    Asset, Control, Device, ErrorKind, MeshSource, OpenBorders, Seams, SolveOptions, SolveRequest, Strided,
    UvSource,
};
use vrtm_testkit::features::set_borders;
use vrtm_testkit::{bits, change, cpu, set_grid, view};

/// A sheet of quads that is cut into `columns` by `rows` charts, with discs of rigidity over all seams.
pub struct CutSheet {
    pub rest: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    indices: Vec<u32>,
}

impl CutSheet {
    /// Each chart has `n` by `n` quads.
    pub fn new([columns, rows]: [usize; 2], n: usize) -> CutSheet {
        let (width, height) = (columns * n, rows * n);
        let at = |x: usize, y: usize| (y * (width + 1) + x) as u32;
        let point = |v: usize| [(v % (width + 1)) as f32, (v / (width + 1)) as f32];
        let size = [width as f32, height as f32];
        let rest = (0..(width + 1) * (height + 1)).map(point).map(|[x, y]| [x / size[0], y / size[1], 0.0]);
        let (mut uvs, mut indices) = (Vec::new(), Vec::new());
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let chart = [x / n, y / n];
            for (x, y) in [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)] {
                indices.push(at(x, y));
                // A gutter of a tenth.
                let uv = |c: usize, x: usize, count: usize| {
                    (c as f32 + 0.05 + 0.9 * (x as f32 / n as f32 - c as f32)) / count as f32
                };
                uvs.push([uv(chart[0], x, columns), uv(chart[1], y, rows)]);
            }
        }
        CutSheet { rest: rest.collect(), uvs, indices }
    }

    /// With the right half of the UV plane in the next tile.
    fn in_two_tiles(mut self) -> CutSheet {
        self.uvs.iter_mut().filter(|uv| uv[0] > 0.5).for_each(|uv| uv[0] += 1.0);
        self
    }

    /// The asset, with collars at all borders or none.
    pub fn asset(&self, device: &Device, size: usize, goes_on: bool) -> Asset {
        let corners: Vec<u32> = (0..self.uvs.len() as u32).collect();
        let source = MeshSource {
            positions: Strided::from_slice(&self.rest),
            face_counts: Some(&vec![4; self.indices.len() / 4]),
            indices: &self.indices,
            uvs: UvSource { u: Strided::from_slice(&self.uvs), v: None, indices: Some(&corners) },
            ..MeshSource::default()
        };
        let mut asset = Asset::new(device, &source).unwrap();
        let discs: Vec<u8> = (0..size * size)
            .map(|k| {
                let [x, y] = [k % size, k / size].map(|x| (8 * x) as f64 / size as f64 % 1.0 - 0.5);
                if x * x + y * y < 0.1 { 255 } else { 0 }
            })
            .collect();
        set_grid(&mut asset, size as u32);
        for tile in 0..asset.tile_count() {
            asset.tile_mut(tile).set_rigidity(Some(view(&discs, size as u32, size as u32))).unwrap();
        }
        if goes_on {
            set_borders(&mut asset, (Seams::Continue, OpenBorders::Slide));
        }
        asset
    }

    pub fn pose(&self, amount: f32) -> Vec<[f32; 3]> {
        self.rest.iter().map(|&[x, y, z]| [x * (1.0 + amount * (3.0 * y).sin()), y, z]).collect()
    }
}

/// A tile of many small charts is a few times as large with collars as without, not a hundred times.
#[test]
fn collars_of_small_charts_are_bounded() {
    let device = cpu(2);
    for (charts, n) in [([40, 1], 4), ([24, 24], 1)] {
        let sheet = CutSheet::new(charts, n);
        let [with, without] = [true, false]
            .map(|on| sheet.asset(&device, 512, on).tile_mut(0).estimate().unwrap().movable_nodes);
        assert!(with > without && with < 5 * without, "{charts:?}: {with} nodes, without collars {without}");
    }
}

#[test]
fn the_same_pose_again_costs_no_blend() {
    let device = cpu(1);
    let sheet = CutSheet::new([2, 1], 8);
    let mut asset = sheet.asset(&device, 64, true);
    let (first, second) = (sheet.pose(0.3), sheet.pose(0.2));
    let mut solve = |pose: &[[f32; 3]], dirty: Option<&[u32]>| {
        let positions = Strided::from_slice(pose);
        asset
            .run(&SolveRequest { positions, dirty_vertices: dirty, ..SolveRequest::default() }, &mut [])
            .unwrap();
        (bits(&asset), asset.tile(0).report().unwrap())
    };
    let (found, report) = solve(&first, None);
    assert!(report.times.blend > 0.0 && report.charts_active == 2);
    for dirty in [None, Some(&[][..])] {
        let (again, same) = solve(&first, dirty);
        assert!(again == found && same.times.blend == 0.0, "{dirty:?}: {} ms", same.times.blend);
        assert_eq!(same.min_jacobian.to_bits(), report.min_jacobian.to_bits());
    }
    let (other, report) = solve(&second, None);
    assert!(other != found && report.times.blend > 0.0);
    assert!(solve(&first, None).0 == found, "the blend of another pose was published");
    // At rest nothing moves, and nothing is left of a blend.
    assert!(solve(&sheet.rest, None).0.iter().flatten().all(|&bits| bits == 0));
}

/// Wherever a call is cancelled, in collars and in the blend, too, the last result stays, and the next call is as ever.
#[test]
fn collars_and_the_blend_can_be_cancelled_anywhere() {
    let device = cpu(1);
    let sheet = CutSheet::new([3, 2], 4);
    let pose = sheet.pose(0.3);
    let solve = |asset: &mut Asset, control: Option<Arc<Control>>| {
        let positions = Strided::from_slice(&pose);
        asset.run(&SolveRequest { positions, control, ..SolveRequest::default() }, &mut [])
    };
    let mut whole = sheet.asset(&device, 32, true);
    solve(&mut whole, None).unwrap();
    let (mut item, mut cancelled) = (1, 0);
    loop {
        let mut asset = sheet.asset(&device, 32, true);
        let control = Arc::new(Control::new());
        control.cancel_at_item(item);
        match solve(&mut asset, Some(control)) {
            Ok(()) => break,
            Err(error) => assert_eq!(error.kind, ErrorKind::Cancelled),
        }
        solve(&mut asset, None).unwrap();
        assert!(bits(&asset) == bits(&whole), "cancelled at item {item}");
        cancelled += 1;
        item = item * 5 / 4 + 1;
    }
    assert!(cancelled > 10, "{cancelled}");
}

/// Memory of solvers that is to be freed is freed where no chart has to be solved, too.
#[test]
fn a_solver_is_released_without_a_solve() {
    let device = cpu(1);
    let sheet = CutSheet::new([2, 1], 4);
    let mut asset = sheet.asset(&device, 64, false);
    let pose = sheet.pose(0.3);
    let mut run = |release_solvers| {
        let positions = Strided::from_slice(&pose);
        asset.run(&SolveRequest { positions, release_solvers, ..SolveRequest::default() }, &mut []).unwrap();
        device.info().bytes_held
    };
    let [kept, released] = [run(false), run(true)];
    assert!(released < kept, "{released} of {kept} bytes");
}

/// A chart without rigidity within reach cannot move: its neighbour stays at their seam, too, and moves elsewhere.
#[test]
fn beside_a_still_chart_both_sides_stay_together() {
    let sheet = CutSheet::new([2, 1], 8);
    let size = 256;
    let mut asset = sheet.asset(&cpu(2), size, true);
    let disc = |k: usize| {
        let [x, y] = [k % size, k / size].map(|x| x as f64 / size as f64);
        255 * u8::from((x - 0.25).hypot(y - 0.5) < 0.12)
    };
    let disc: Vec<u8> = (0..size * size).map(disc).collect();
    asset.tile_mut(0).set_rigidity(Some(view(&disc, size as u32, size as u32))).unwrap();
    change(&mut asset, 0, |settings| settings.open_borders = OpenBorders::Fixed);
    let pose: Vec<[f32; 3]> = sheet.rest.iter().map(|&[x, y, z]| [2.0 * x, y, z]).collect();
    asset.solve(Strided::from_slice(&pose), &SolveOptions::default()).unwrap();
    let uvs = vrtm_testkit::corner_uvs(&asset);
    // In cells, of corners on a line u = constant.
    let most = |u: f32| {
        let at_line = sheet.uvs.iter().zip(&uvs).filter(|(own, _)| (own[0] - u).abs() < 1e-6);
        at_line.map(|(own, uv)| (uv[0] - own[0]).abs().max((uv[1] - own[1]).abs())).fold(0.0, f32::max)
            * size as f32
    };
    let report = asset.tile(0).report().unwrap();
    assert_eq!(report.charts_active, 1, "the other chart is still");
    let [inside, left, right] = [0.025 + 0.45 * 0.75, 0.475, 0.525].map(most);
    assert!(right == 0.0 && left < 0.05 && inside > 1.0, "{inside}, at the seam {left} and {right} cells");
}

/// Nodes of a collar are free where the mask of the tile that it lies in leaves them free.
#[test]
fn the_mask_of_a_neighbour_holds_in_collars() {
    let sheet = CutSheet::new([2, 1], 8).in_two_tiles();
    let nodes = |goes_on: bool, masked: bool| {
        let mut asset = sheet.asset(&cpu(1), 64, goes_on);
        let fixed = masked.then(|| view(&[0u8; 4], 2, 2));
        asset.tile_mut(1).set_mask(fixed).unwrap();
        asset.tile_mut(0).info().unwrap().movable_nodes
    };
    let [alone, masked, free] =
        [(false, false), (true, true), (true, false)].map(|(on, mask)| nodes(on, mask));
    assert!(alone <= masked && masked < free, "{alone} nodes, in collars {masked} and {free}");
}

/// If the collar of one of two charts has no room beside a part of their seam, neither side moves over that part, so
/// that both stay together; over the rest of the seam texture moves.
#[test]
fn beside_a_slit_both_sides_stay_together() {
    const SIZE: usize = 256;
    // In quads of the plane: the first chart ends at the seam, which is 17 quads long. The second one begins there, and
    // beyond the seam's end turns back, so that beside the second half of the seam it lies a slit away from itself.
    let (quad, slit, ends) = (0.0225, 0.13, [0.31f32, 0.47]);
    let mut sheet = CutSheet { rest: Vec::new(), uvs: Vec::new(), indices: Vec::new() };
    let mut vertices = std::collections::BTreeMap::new();
    let mut add = |chart: usize, [x, next]: [f32; 2], rows: std::ops::Range<usize>| {
        for y in rows {
            for (x, y) in [(x, y), (next, y), (next, y + 1), (x, y + 1)] {
                // The first chart stands upright on the second one.
                let point = if chart == 0 { [0.0, y as f32, 0.0 - x] } else { [x, y as f32, 0.0] };
                let v = *vertices.entry(point.map(f32::to_bits)).or_insert(sheet.rest.len() as u32);
                sheet.rest.resize(sheet.rest.len().max(v as usize + 1), point);
                sheet.indices.push(v);
                sheet.uvs.push([ends[chart] + quad * x, 0.1 + quad * y as f32]);
            }
        }
    };
    for x in 0..12 {
        let x = x as f32;
        add(0, [x - 12.0, x - 11.0], 0..17);
        add(1, [x, x + 1.0], 0..20);
    }
    (0..4).for_each(|x| add(1, [x as f32 - 4.0 - slit, x as f32 - 3.0 - slit], 10..20));
    add(1, [-slit, 0.0], 17..20);
    let mut asset = sheet.asset(&cpu(2), SIZE, true);
    let disc = |k: usize| {
        let at = [k % SIZE, k / SIZE].map(|x| (x as f32 + 0.5) / SIZE as f32);
        let chart = usize::from(at[0] > 0.5 * (ends[0] + ends[1]));
        let [x, y] = [(at[0] - ends[chart]) / quad, (1.0 - at[1] - 0.1) / quad];
        let near = [4.5, 13.5].into_iter().any(|row| (x + 0.3).hypot(y - row) < 0.8);
        255 * u8::from(near && (chart == 0) == (x < 0.0))
    };
    let discs: Vec<u8> = (0..SIZE * SIZE).map(disc).collect();
    asset.tile_mut(0).set_rigidity(Some(view(&discs, SIZE as u32, SIZE as u32))).unwrap();
    change(&mut asset, 0, |settings| settings.open_borders = OpenBorders::Fixed);
    let pose: Vec<[f32; 3]> = sheet.rest.iter().map(|&[x, y, z]| [1.6 * x, y, 1.6 * z]).collect();
    asset.solve(Strided::from_slice(&pose), &SolveOptions::default()).unwrap();
    let uvs = vrtm_testkit::corner_uvs(&asset);
    // By how many cells both sides move at a vertex of the seam.
    let moved = |chart: usize, row: usize| {
        let at = [ends[chart], 0.1 + quad * row as f32];
        let k = sheet.uvs.iter().position(|own| *own == at).unwrap();
        [0, 1].map(|c| (uvs[k][c] - at[c]) * SIZE as f32)
    };
    let most = |chart: usize, rows: std::ops::Range<usize>| {
        rows.flat_map(|row| moved(chart, row)).fold(0.0f32, |most, x| most.max(x.abs()))
    };
    let [shut, open] = [10..17, 0..10].map(|rows| [0, 1].map(|chart| most(chart, rows.clone())));
    assert!(
        shut == [0.0; 2] && open.iter().all(|&x| x > 0.3),
        "beside the slit {shut:?}, elsewhere {open:?}"
    );
}
