//! Results depend on the mesh, the maps, the settings and the pose alone, whatever was set, painted, torn, solved,
//! cancelled and released before: random histories of an asset, in which each result is compared with that of a fresh
//! asset, bit for bit.
//!
//! Left out is what depends on the past by intention: a warm start, a time budget, and reports of times, memory and
//! work.

use std::sync::Arc;

use vrtm::{
    Asset, Control, Device, ErrorKind, FetchKind, OpenBorders, Overlap, Quality, Scale, Seams, SolveOptions,
    SolveRequest, Strided, TileSettings, Weld, WeldBy,
};
use vrtm_testkit::random::Random;
use vrtm_testkit::{Model, cpu, fetch, on_all_cores, options, view};

/// Quads on a side of a sheet.
const QUADS: usize = 6;
/// Texels on a side of a map.
const SIZE: usize = 64;
/// Histories, and solves in each.
const HISTORIES: u64 = 12;
const STEPS: usize = 18;
/// The asset has two tiles.
pub const TILES: usize = 2;

/// Five sheets, each a chart. The first three hang together at seams, which lie within the first tile and between both;
/// the fourth is beside them, and the last lies over it.
const SHEETS: [[f32; 2]; 5] = [[0.08, 0.1], [0.55, 0.15], [1.1, 0.1], [1.55, 0.1], [1.6, 0.4]];
const SIDE: f32 = 0.36;

/// The sheets, with a slit in the middle of each that is closed at rest, and poses. The last two open slits: of all
/// sheets, and of the first one alone.
pub fn model() -> Model {
    let row = QUADS + 1;
    let mut model = Model {
        weld: Weld { by: WeldBy::Position, ..Weld::default() },
        frames: vec![Vec::new(); 5],
        ..Model::default()
    };
    for (sheet, low) in SHEETS.into_iter().enumerate() {
        let is_slit = |[i, j]: [usize; 2]| j == QUADS / 2 && (2..QUADS - 1).contains(&i);
        let mut vertex = |at: [usize; 2], above: bool| {
            let [x, y] = at.map(|k| k as f32 / QUADS as f32);
            let gap = if sheet < 3 { 0.0 } else { 0.5 };
            let along = sheet as f32 + gap + x;
            let p = [along, y, 0.2 * along.sin() * (y - 0.5)];
            model.rest.push(p);
            let opens = if above && is_slit(at) { 0.1 } else { 0.0 };
            let bent =
                |a: f32| [p[0] + a * (3.0 * p[0]).sin(), p[1] * (1.0 + a * p[0].sin()), p[2] + a * p[0]];
            let [once, twice] = [0.12, 0.2].map(bent);
            let first = if sheet == 0 { opens } else { 0.0 };
            let poses =
                [p, once, twice, [once[0], once[1] + opens, once[2]], [once[0], once[1] + first, once[2]]];
            model.frames.iter_mut().zip(poses).for_each(|(frame, p)| frame.push(p));
            model.uvs.push([low[0] + SIDE * x, low[1] + SIDE * y]);
            model.rest.len() as u32 - 1
        };
        let all: Vec<[u32; 2]> = (0..row * row)
            .map(|k| {
                let at = [k % row, k / row];
                let below = vertex(at, false);
                [below, if is_slit(at) { vertex(at, true) } else { below }]
            })
            .collect();
        for (i, j) in (0..QUADS * QUADS).map(|k| (k % QUADS, k / QUADS)) {
            let side = usize::from(j >= QUADS / 2);
            let corner = |di: usize, dj: usize| all[(j + dj) * row + i + di][side];
            model.indices.extend([corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]);
            model.face_counts.push(4);
        }
    }
    model.uv_indices = model.indices.clone();
    model
}

/// State that a host has set.
#[derive(Clone)]
struct Given {
    rigidity: [Option<Vec<u8>>; TILES],
    mask: [Option<Vec<u8>>; TILES],
    of_vertices: [Option<Vec<f32>>; 2],
    settings: [TileSettings; TILES],
    frozen: [bool; TILES],
}

fn image(texels: &[u8]) -> vrtm::ImageView<'_> {
    view(texels, SIZE as u32, SIZE as u32)
}

fn painted(random: &mut Random) -> Vec<u8> {
    let (pitch, radius) = (8 + random.below(8), 2 + random.below(3));
    let is_in = |k: usize| [k % SIZE, k / SIZE].iter().all(|x| x % pitch < 2 * radius);
    (0..SIZE * SIZE).map(|k| if is_in(k) { 255 } else { 0 }).collect()
}

impl Given {
    fn new(random: &mut Random) -> Given {
        let settings = TileSettings { grid: [Some(32); 2], seam_reach: 0.06, ..TileSettings::default() };
        Given {
            rigidity: [0; TILES].map(|_| Some(painted(random))),
            mask: [const { None }; TILES],
            of_vertices: [None, None],
            settings: [Seams::Continue, random.one(&[Seams::Shut, Seams::Keep, Seams::Continue])]
                .map(|seams| TileSettings { seams, ..settings }),
            frozen: [false; TILES],
        }
    }

    /// An asset that knows nothing else.
    fn fresh(&self, model: &Model, device: &Device) -> Asset {
        let mut asset = model.bare_on(device, Strided::from_slice(&model.rest));
        asset.set_vertex_rigidity(self.of_vertices[0].as_deref().map(Strided::from_slice)).unwrap();
        asset.set_vertex_mask(self.of_vertices[1].as_deref().map(Strided::from_slice)).unwrap();
        for tile in 0..TILES {
            asset.tile_mut(tile).set_settings(&self.settings[tile]).unwrap();
            asset.tile_mut(tile).set_rigidity(self.rigidity[tile].as_deref().map(image)).unwrap();
            asset.tile_mut(tile).set_mask(self.mask[tile].as_deref().map(image)).unwrap();
            asset.tile_mut(tile).freeze(self.frozen[tile]).unwrap();
        }
        asset
    }

    /// Changes something, here and in the asset; says what.
    fn change(&mut self, asset: &mut Asset, random: &mut Random, vertices: usize) -> String {
        let tile = random.below(TILES);
        let what = random.below(20);
        match what {
            0 | 1 => {
                self.rigidity[tile] = random.chance(92).then(|| painted(random));
                asset.tile_mut(tile).set_rigidity(self.rigidity[tile].as_deref().map(image)).unwrap();
                format!("rigidity of {tile}: {}", self.rigidity[tile].is_some())
            }
            2 => {
                let edge = random.below(SIZE);
                let left = |k: usize| if k % SIZE < edge { 0 } else { 255 };
                self.mask[tile] = random.chance(60).then(|| (0..SIZE * SIZE).map(left).collect());
                asset.tile_mut(tile).set_mask(self.mask[tile].as_deref().map(image)).unwrap();
                format!("mask of {tile}: {edge}")
            }
            3 => {
                let which = random.below(2);
                let step = 2 + random.below(3);
                let number = |v: usize| if v % 7 < step { 1.0 } else { 0.0 };
                self.of_vertices[which] = random.chance(70).then(|| (0..vertices).map(number).collect());
                let of = self.of_vertices[which].as_deref().map(Strided::from_slice);
                if which == 0 { asset.set_vertex_rigidity(of) } else { asset.set_vertex_mask(of) }.unwrap();
                format!("vertices: {which} {step}")
            }
            4..=8 => {
                let settings = &mut self.settings[tile];
                match random.below(12) {
                    0..=2 => settings.room = random.one(&[0.3, 0.1]),
                    3 | 4 => settings.harm = random.one(&[10.0, 0.0]),
                    5 => settings.smoothness = random.one(&[0.02, 0.1]),
                    6 => settings.grid = random.one(&[[Some(32); 2], [Some(16), Some(48)], [None; 2]]),
                    7 => settings.overlap = random.one(&[Overlap::Fixed, Overlap::FirstFace]),
                    8 => settings.seam_reach = random.one(&[0.06, 0.1]),
                    9 => settings.open_borders = random.one(&[OpenBorders::Fixed, OpenBorders::Slide]),
                    _ => {
                        let all = [Seams::Shut, Seams::Keep, Seams::Continue, Seams::Continue];
                        settings.seams = random.one(&all);
                    }
                }
                let goes_on =
                    settings.seams == Seams::Continue || settings.open_borders == OpenBorders::Slide;
                settings.orientation_density = if !goes_on && random.chance(15) { 0.5 } else { 0.0 };
                settings.smoothness_floor = if random.chance(85) { 5e-4 } else { 2e-3 };
                asset.tile_mut(tile).set_settings(settings).unwrap();
                format!("{tile}: {settings:?}")
            }
            9 => {
                self.frozen[tile] = random.chance(30);
                asset.tile_mut(tile).freeze(self.frozen[tile]).unwrap();
                format!("{tile} is frozen: {}", self.frozen[tile])
            }
            10 => {
                let bytes = asset.tile_mut(tile).save().unwrap();
                asset.tile_mut(tile).load(&bytes).unwrap();
                format!("{tile} is loaded")
            }
            11 => {
                asset.tile_mut(tile).estimate().unwrap();
                asset.tile_mut(tile).info().unwrap();
                format!("{tile} is looked at")
            }
            _ => {
                // A long drag of the brush makes hundreds of strokes.
                let count = if random.chance(2) { 300 } else { 1 + random.below(3) };
                for _ in 0..count {
                    self.stroke(asset, tile, random);
                }
                format!("{count} strokes in {tile}")
            }
        }
    }

    fn stroke(&mut self, asset: &mut Asset, tile: usize, random: &mut Random) {
        let Some(texels) = &mut self.rigidity[tile] else { return };
        let size = [1 + random.below(6), 1 + random.below(6)];
        let first = size.map(|n| random.below(SIZE - n + 1));
        let value = random.one(&[0, 128, 255]);
        for y in first[1]..first[1] + size[1] {
            texels[y * SIZE + first[0]..][..size[0]].fill(value);
        }
        let [first, size] = [first, size].map(|pair| pair.map(|x| x as u32));
        asset.tile_mut(tile).update_rigidity(image(texels), first, size).unwrap();
    }
}

/// The bits of a warp and of a map, and a report in f64 and in whole numbers.
type Seen = (Vec<[u32; 2]>, Vec<[u32; 2]>, [f64; 3], [u32; 7]);

/// All that a host sees of a tile's result, but for what it cost.
fn seen(asset: &mut Asset, tile: usize) -> Seen {
    let report = asset.tile(tile).report().unwrap();
    let [nx, ny] = report.grid;
    let warp = fetch(asset, tile, FetchKind::Warp, [nx + 1, ny + 1]);
    let map = fetch(asset, tile, FetchKind::RedirectionUdim, [40, 40]);
    let [warp, map] = [warp, map].map(|pairs| pairs.into_iter().map(|uv| uv.map(f32::to_bits)).collect());
    (
        warp,
        map,
        [report.energy, report.min_jacobian, f64::from(report.max_displacement)],
        [
            report.charts,
            report.charts_fallback,
            report.folds as u32,
            nx,
            ny,
            report.welds_torn,
            report.charts_apart,
        ],
    )
}

/// Counts of events in histories.
#[derive(Clone, Copy, Default)]
struct Counts {
    compared: u32,
    moved: u32,
    reused: u32,
    kept: u32,
    torn: u32,
    extended: u32,
    cancelled: u32,
}

fn history(model: &Model, seed: u64, steps: usize) -> Counts {
    let mut random = Random(seed);
    let (device, mut given, mut counts) = (cpu(1), Given::new(&mut random), Counts::default());
    let mut asset = given.fresh(model, &device);
    // The pose that each tile was solved for last.
    let mut poses: [Option<usize>; TILES] = [None; TILES];
    let mut past = Vec::new();
    for _ in 0..steps {
        for _ in 0..random.one(&[0, 0, 1, 1, 2]) {
            past.push(given.change(&mut asset, &mut random, model.rest.len()));
        }
        let pose = if random.chance(60) { poses[0].unwrap_or(1) } else { random.below(model.frames.len()) };
        let options = SolveOptions {
            measure: random.chance(10),
            scale: random.one(&[Scale::Keep, Scale::Keep, Scale::Follow]),
            ..options(if random.chance(90) { Quality::Normal } else { Quality::Draft })
        };
        let some = [random.below(TILES)];
        let tiles = random.chance(25).then_some(&some[..]);
        let dirty = random.chance(65).then(|| dirty(model, &poses, pose));
        let request = SolveRequest {
            positions: Strided::from_slice(&model.frames[pose]),
            options,
            tiles,
            dirty_vertices: dirty.as_deref(),
            release_last: random.chance(10),
            release_solvers: random.chance(10),
            ..SolveRequest::default()
        };
        let asked = |tile: usize| !given.frozen[tile] && tiles.is_none_or(|tiles| tiles.contains(&tile));
        if random.chance(15) {
            let control = Arc::new(Control::new());
            control.cancel_at_item(1 + random.below(400) as u64);
            let control = Some(control);
            match asset.run(&SolveRequest { control, ..request.clone() }, &mut []) {
                Ok(()) => past.push(format!("nearly cancelled {pose}")),
                Err(error) => {
                    assert_eq!(error.kind, ErrorKind::Cancelled);
                    counts.cancelled += 1;
                    past.push(format!("cancelled {pose}"));
                    // It may have had results to release.
                    if request.release_last {
                        continue;
                    }
                }
            }
        }
        asset.run(&request, &mut []).unwrap();
        past.push(format!("solved {pose}, {tiles:?}, {options:?}, dirty: {}", dirty.is_some()));
        let mut fresh = given.fresh(model, &device);
        fresh.run(&SolveRequest { dirty_vertices: None, ..request }, &mut []).unwrap();
        for tile in (0..TILES).filter(|&tile| asked(tile)) {
            poses[tile] = Some(pose);
            let report = asset.tile(tile).report().unwrap();
            let result = seen(&mut asset, tile);
            counts.compared += 1;
            counts.moved += u32::from(result.2[2] > 0.0);
            counts.reused += u32::from(report.charts_reused > 0);
            counts.kept += u32::from(report.kept);
            counts.torn += u32::from(report.welds_torn > 0);
            counts.extended += u32::from(asset.result_inside(tile).unwrap().extended().is_some());
            // The bytes of a tile are all that is prepared of it.
            assert!(
                result == seen(&mut fresh, tile)
                    && asset.tile_mut(tile).save().unwrap() == fresh.tile_mut(tile).save().unwrap(),
                "seed {seed}: tile {tile} differs from that of a fresh asset:\n{}",
                past.join("\n")
            );
        }
    }
    drop(asset);
    assert_eq!(device.info().bytes_held, 0, "seed {seed}: bytes are still booked");
    counts
}

/// The vertices whose positions are others than in the poses that tiles were solved for.
fn dirty(model: &Model, poses: &[Option<usize>], pose: usize) -> Vec<u32> {
    let has_moved = |v: &u32| {
        let at = |pose: usize| model.frames[pose][*v as usize];
        poses.iter().any(|before| before.is_none_or(|before| at(before) != at(pose)))
    };
    (0..model.rest.len() as u32).filter(has_moved).collect()
}

#[test]
fn results_are_those_of_fresh_assets() {
    let (model, seeds) = (model(), (1..=HISTORIES).collect::<Vec<u64>>());
    let counts = on_all_cores(&seeds, |&seed| history(&model, seed, STEPS));
    let sum = |of: fn(&Counts) -> u32| counts.iter().map(of).sum::<u32>();
    let all = sum(|c| c.compared);
    let shares = [
        ("moved", sum(|c| c.moved), 2),
        ("with reused charts", sum(|c| c.reused), 30),
        ("kept", sum(|c| c.kept), 30),
        ("torn", sum(|c| c.torn), 8),
        ("with collars", sum(|c| c.extended), 4),
        ("cancelled", sum(|c| c.cancelled), 40),
    ];
    println!("{all} results; {shares:?}");
    for (what, count, least) in shares {
        assert!(count * least > all, "{what}: {count} of {all}");
    }
}

/// Each setting by itself, of a tile and of its neighbour, there and back, while no vertex moves.
#[test]
fn each_setting_is_followed() {
    type Change = fn(&mut TileSettings);
    let changes: [(&str, Change); 10] = [
        ("seams that are kept", |settings| settings.seams = Seams::Keep),
        ("seams that are shut", |settings| settings.seams = Seams::Shut),
        ("open borders", |settings| settings.open_borders = OpenBorders::Slide),
        ("reach", |settings| settings.seam_reach = 0.1),
        ("overlap", |settings| settings.overlap = Overlap::FirstFace),
        ("grid", |settings| settings.grid = [Some(16), Some(48)]),
        ("smoothness", |settings| settings.smoothness = 0.1),
        ("floor of smoothness", |settings| settings.smoothness_floor = 2e-3),
        ("room", |settings| settings.room = 0.1),
        ("orientation", |settings| settings.orientation = 0.3),
    ];
    let (model, device, mut given) = (model(), cpu(1), Given::new(&mut Random(1)));
    given.settings[1] = given.settings[0];
    let solve = |asset: &mut Asset, dirty_vertices| {
        let positions = Strided::from_slice(&model.frames[2]);
        asset.run(&SolveRequest { positions, dirty_vertices, ..SolveRequest::default() }, &mut []).unwrap();
        [0, 1].map(|tile| seen(asset, tile))
    };
    let mut asset = given.fresh(&model, &device);
    let mut before = solve(&mut asset, None);
    let all = changes.into_iter().flat_map(|change| [(change, 0), (change, 1)]);
    // At the end again what is kept in place of shut, where no collar changes.
    for (n, ((what, change), tile)) in all.chain([(changes[0], 0), (changes[0], 1)]).enumerate() {
        if n == 2 * changes.len() {
            given.settings.iter_mut().for_each(|settings| settings.seams = Seams::Shut);
            asset = given.fresh(&model, &device);
            before = solve(&mut asset, None);
        }
        let mut changed = given.clone();
        change(&mut changed.settings[tile]);
        asset.tile_mut(tile).set_settings(&changed.settings[tile]).unwrap();
        let found = solve(&mut asset, Some(&[]));
        // No charts lie over one another in the first tile.
        assert!(tile == 0 || found[1] != before[1], "{what} changes nothing");
        assert!(found == solve(&mut changed.fresh(&model, &device), None), "{what} of tile {tile}");
        asset.tile_mut(tile).set_settings(&given.settings[tile]).unwrap();
        assert!(solve(&mut asset, Some(&[])) == before, "{what} of tile {tile}, and back");
    }
}
