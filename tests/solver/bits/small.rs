//! Small scenes, each with one thing that changes a result.

use vrtm::{
    Asset, Device, ImageLayout, ImageView, MeshSource, OpenBorders, Origin, PbdSettings, PixelFormat,
    Quality, Seams, SolveOptions, Solver, Strided, TileSettings, UvSource, Weld, WeldBy, f16,
};

use super::hash::Hash;
use super::outputs::{kinds, result};
use crate::{cuts, gaps, hard_cases, noise, open_borders, random, seams, welds};
use vrtm_testkit::features::dense::dense;
use vrtm_testkit::scenes::{analytic, arm, by_name, creature, mug_to_jug};
use vrtm_testkit::{Model, assets, options, view};

/// Model, and the options of its solves.
#[derive(Clone)]
pub struct Small {
    pub what: String,
    model: Model,
    grid: [u32; 2],
    settings: TileSettings,
    options: SolveOptions,
    /// Frames that are solved one after the other, numbered from 1.
    frames: Vec<usize>,
    prepare: fn(&mut Asset),
    /// True if a software GPU has the time for it.
    pub on_gpu: bool,
}

impl Small {
    fn new(model: &Model, what: impl Into<String>) -> Small {
        Small {
            what: what.into(),
            model: model.clone(),
            grid: [64; 2],
            settings: TileSettings::default(),
            options: SolveOptions::default(),
            frames: vec![model.frames.len()],
            prepare: |_| (),
            on_gpu: false,
        }
    }

    pub fn scene(&self) -> &str {
        &self.model.name
    }

    pub fn hash(&self, device: &Device) -> Hash {
        let mut asset = self.model.asset_on(device, 16);
        let settings = TileSettings { grid: self.grid.map(Some), ..self.settings };
        (0..asset.tile_count()).for_each(|tile| asset.tile_mut(tile).set_settings(&settings).unwrap());
        (self.prepare)(&mut asset);
        for &frame in &self.frames {
            asset.solve(self.model.frame(frame), &self.options).unwrap();
        }
        result(&mut asset)
    }
}

fn named(name: &str, model: impl Into<Model>) -> Model {
    Model { name: name.into(), ..model.into() }
}

/// Each setting of a tile by itself, in a crowded scene.
fn settings(list: &mut Vec<Small>) {
    let crowded = named("squash to 40 %", analytic::squash(0.4));
    let default = TileSettings::default();
    for (what, settings, on_gpu) in [
        ("smoothness", TileSettings { smoothness: 0.2, ..default }, true),
        ("smoothness floor", TileSettings { smoothness_floor: 0.01, ..default }, false),
        ("orientation", TileSettings { orientation: 0.3, ..default }, true),
        ("no room", TileSettings { room: 0.0, ..default }, false),
        ("room", TileSettings { room: 3.0, room_threshold: 0.7, ..default }, true),
        ("harm 0", TileSettings { harm: 0.0, ..default }, true),
    ] {
        list.push(Small { settings, on_gpu, ..Small::new(&crowded, what) });
    }
    let crowded = dense(&named("bulge", analytic::bulge()));
    list.push(Small { grid: [256; 2], on_gpu: true, ..Small::new(&crowded, "harm") });
    for grid in [[16, 16], [16, 128], [96, 32], [300, 48]] {
        let [width, height] = grid;
        let what = format!("{width} by {height} cells");
        list.push(Small { grid, on_gpu: width < 100, ..Small::new(&mug_to_jug().into(), what) });
    }
}

/// The options of a solve.
fn solves(list: &mut Vec<Small>) {
    let crowded = named("squash to 40 %", analytic::squash(0.4));
    let default = SolveOptions::default();
    let pbd = |pbd: PbdSettings| SolveOptions { solver: Solver::Pbd, pbd, ..default };
    let few = PbdSettings { iterations: 5, ..PbdSettings::default() };
    for (what, options) in [
        ("tolerance", SolveOptions { tolerance: Some(0.1), ..default }),
        ("one correction", SolveOptions { max_corrections: Some(1), ..default }),
        ("twelve corrections", SolveOptions { max_corrections: Some(12), tolerance: Some(1e-6), ..default }),
        ("measured", SolveOptions { measure: true, ..default }),
        ("pbd, damping", pbd(PbdSettings { damping: 0.4, ..few })),
        ("pbd, smoothing", pbd(PbdSettings { smoothing: 0.2, ..few })),
        ("pbd, coarse correction", pbd(PbdSettings { coarse_correction: 0.2, ..few })),
    ] {
        list.push(Small { options, ..Small::new(&crowded, what) });
    }
    for (what, weight) in [("three frames, warm", 0.0), ("three frames, held", 0.3)] {
        let options = SolveOptions { warm: true, temporal_weight: weight, ..default };
        list.push(Small { options, frames: vec![1, 2, 3], ..Small::new(&arm().into(), what) });
    }
}

/// Seams and open borders, in scenes and in sheets that are cut or cut out.
fn borders(list: &mut Vec<Small>) {
    use OpenBorders::{Fixed, Slide};
    use Seams::{Continue, Keep, Shut};
    let default = TileSettings::default();
    let real = assets().into_iter().filter(|model| ["fox", "spot"].contains(&&*model.name));
    let scenes = [creature(), arm(), mug_to_jug(), by_name("strips").unwrap()];
    for model in scenes.map(Model::from).into_iter().chain(real) {
        for (seams, open_borders) in [(Continue, Fixed), (Keep, Fixed), (Shut, Slide), (Continue, Slide)] {
            let what = format!("seams {seams:?}, open borders {open_borders:?}");
            let settings = TileSettings { seams, open_borders, ..default };
            let on_gpu = model.name == "creature";
            list.push(Small { settings, on_gpu, grid: [96; 2], ..Small::new(&model, what) });
        }
    }
    let model = creature().into();
    let settings = TileSettings { seams: Keep, open_borders: Slide, ..default };
    list.push(Small { settings, ..Small::new(&model, "seams Keep, open borders Slide") });
    let settings = TileSettings { seams: Continue, seam_reach: 0.15, ..default };
    list.push(Small { settings, ..Small::new(&model, "a far reach") });
    let settings = TileSettings { seams: Continue, open_borders: Slide, ..default };
    let options = SolveOptions { warm: true, temporal_weight: 0.1, ..SolveOptions::default() };
    let all = Small::new(&model, "all goes on, held");
    list.push(Small { settings, options, frames: vec![3, 4], ..all });
    for (what, place) in seams::places() {
        let settings = TileSettings { seams: Continue, ..default };
        list.push(Small { settings, grid: [128; 2], ..Small::new(&seams::sheet(Some(place)), what) });
    }
    for round in [true, false] {
        let model = open_borders::sheet(round).model;
        for solver in [Solver::Descent, Solver::Pbd] {
            let settings = TileSettings { open_borders: Slide, ..default };
            let options = SolveOptions { solver, ..SolveOptions::default() };
            list.push(Small { settings, options, ..Small::new(&model, format!("sliding, {solver:?}")) });
        }
    }
}

/// Meshes that are welded, torn, cut, split by a gap, overlapping, or noisy.
fn meshes(list: &mut Vec<Small>) {
    for by in [WeldBy::Index, WeldBy::Position, WeldBy::Off] {
        let model = Model { weld: Weld { by, ..Weld::default() }, ..welds::slit(true).0 };
        let on_gpu = by == WeldBy::Position;
        let slit = Small::new(&model, format!("a slit that opens, welded by {by:?}"));
        list.push(Small { on_gpu, ..slit });
    }
    for (what, model) in gaps::small() {
        list.push(Small { grid: [96; 2], ..Small::new(&named("gaps", model), what) });
    }
    list.push(Small { grid: [128; 2], ..Small::new(&cuts::small(), "a T, between lines") });
    let sheet = noise::sheet([0.125, 0.875]);
    for (what, by_face) in [("noise by corner", false), ("noise by face", true)] {
        list.push(Small::new(&named("noise", noise::noisy(&sheet, 2e-5, by_face)), what));
    }
    let layered = Model::from(mug_to_jug()).twice();
    list.push(Small { on_gpu: true, ..Small::new(&layered, "two layers") });
    let settings = TileSettings { seams: Seams::Continue, ..TileSettings::default() };
    list.push(Small { settings, ..Small::new(&layered, "two layers, seams Continue") });
    let seams = (0..40).map(|k| [k, k + 1]).collect();
    list.push(Small::new(&Model { seams, ..analytic::torus().into() }, "seams of the host"));
}

/// Maps and values of vertices.
fn maps(list: &mut Vec<Small>) {
    const SIDE: u32 = 50;
    fn value(k: u32) -> f32 {
        let [x, y] = [k % SIDE, k / SIDE].map(|x| (f64::from(x) / 7.0).fract() - 0.5);
        (1.2 - 2.5 * x.hypot(y)).clamp(0.0, 1.0) as f32
    }
    fn paint<const N: usize>(
        asset: &mut Asset,
        format: PixelFormat,
        origin: Origin,
        texel: fn(f32) -> [u8; N],
    ) {
        let bytes: Vec<u8> = (0..SIDE * SIDE).flat_map(|k| texel(value(k))).collect();
        let layout = ImageLayout { origin, ..ImageLayout::packed(SIDE, SIDE, format) };
        asset.tile_mut(0).set_rigidity(Some(ImageView::new("map", &bytes, layout).unwrap())).unwrap();
    }
    fn of_vertices(asset: &Asset, least: f32) -> Vec<f32> {
        (0..asset.info().vertices).map(|v| if v % 7 < 3 { 1.0 } else { least }).collect()
    }
    type Change = fn(&mut Asset);
    let changes: [(&str, Change); 7] = [
        ("rigidity of 16 bits", |asset| {
            paint(asset, PixelFormat::U16, Origin::Top, |x| ((x * 65535.0) as u16).to_ne_bytes());
        }),
        ("rigidity of halves", |asset| {
            paint(asset, PixelFormat::F16, Origin::Bottom, |x| f16::from_f32(x).to_ne_bytes());
        }),
        ("rigidity of floats", |asset| paint(asset, PixelFormat::F32, Origin::Top, f32::to_ne_bytes)),
        ("rigidity of vertices", |asset| {
            let values = of_vertices(asset, 0.1);
            asset.tile_mut(0).set_rigidity(None).unwrap();
            asset.set_vertex_rigidity(Some(Strided::from_slice(&values))).unwrap();
        }),
        ("a mask", |asset| {
            let mask: Vec<u8> = (0..32 * 32).map(|k| if k % 32 / 9 == 1 { 0 } else { 255 }).collect();
            asset.tile_mut(0).set_mask(Some(view(&mask, 32, 32))).unwrap();
        }),
        ("a mask of vertices", |asset| {
            let values: Vec<f32> = of_vertices(asset, 0.0).iter().map(|x| 1.0 - x).collect();
            asset.set_vertex_mask(Some(Strided::from_slice(&values))).unwrap();
        }),
        ("a stroke", |asset| {
            let stroke = vec![255; 512 * 512];
            asset.tile_mut(0).update_rigidity(view(&stroke, 512, 512), [200, 180], [90, 120]).unwrap();
        }),
    ];
    for (what, prepare) in changes {
        let on_gpu = what == "a mask";
        list.push(Small { prepare, on_gpu, ..Small::new(&analytic::bulge().into(), what) });
    }
}

pub fn small() -> Vec<Small> {
    let mut list = Vec::new();
    [settings, solves, borders, meshes, maps].iter().for_each(|add| add(&mut list));
    list
}

/// The hard cases, but those that a time budget ends.
pub fn hard() -> Vec<(String, Hash)> {
    let cases = hard_cases::certain();
    vrtm_testkit::on_all_cores(&cases, |case| {
        let mut hash = Hash::default();
        hash.integers(case.run(1).0);
        (case.name.to_owned(), hash)
    })
}

/// Random models, in groups: all that may be set, in combinations that nobody thinks of.
pub fn drawn(device: &Device, groups: &[u64]) -> Vec<(String, Hash)> {
    const GROUP: usize = 20;
    vrtm_testkit::on_all_cores(groups, |&seed| {
        let mut hash = Hash::default();
        for recipe in random::recipes(seed, GROUP) {
            let model = recipe.model();
            let mut asset = recipe.asset(&model, device).unwrap();
            for pose in &model.poses {
                recipe.solve(&mut asset, pose).unwrap();
                hash.add(result(&mut asset).0);
            }
        }
        (format!("{GROUP} of seed {seed}"), hash)
    })
}

/// Each kind of output of the second tile of a scene with a second UV set, which goes on beyond its seams.
pub fn outputs(device: &Device) -> Vec<(&'static str, Hash)> {
    let model = Model::from(arm());
    let second: Vec<[f32; 2]> = model.uvs.iter().map(|[u, v]| [0.1 + 0.6 * v, 0.9 - 0.3 * u]).collect();
    let uvs = |uvs| UvSource { u: Strided::from_slice(uvs), v: None, indices: Some(&model.uv_indices) };
    let source = MeshSource {
        positions: Strided::from_slice(&model.rest),
        face_counts: Some(&model.face_counts),
        indices: &model.indices,
        uvs: uvs(&model.uvs),
        uv_sets: &[uvs(&second)],
        ..MeshSource::default()
    };
    let mut asset = Asset::new(device, &source).unwrap();
    model.maps.iter().for_each(|maps| vrtm_testkit::paint(&mut asset, maps));
    for tile in 0..asset.tile_count() {
        let grid = [Some(if tile < 2 { 80 } else { 16 }); 2];
        let settings = TileSettings { grid, seams: Seams::Continue, ..TileSettings::default() };
        asset.tile_mut(tile).set_settings(&settings).unwrap();
    }
    asset.solve(model.frame(3), &options(Quality::Normal)).unwrap();
    let tile = asset.find_tile(1002).unwrap();
    kinds(&mut asset, tile, |asset| asset.solve(model.frame(2), &options(Quality::Normal)).unwrap())
}
