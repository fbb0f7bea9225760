//! A tile that gets a whole new rigidity keeps what does not depend on it, and is then what a fresh asset with that
//! rigidity is, bit for bit: as it is prepared, and solved.

use crate::fresh::{TILES, model};
use vrtm::{
    Asset, ImageLayout, ImageView, OpenBorders, Overlap, PixelFormat, Quality, Seams, Strided, TileSettings,
};
use vrtm_testkit::{Model, bits, cpu, options};

/// Texels, and their number on a side.
#[derive(Clone)]
struct Texels {
    size: usize,
    values: Vec<f32>,
    format: PixelFormat,
}

impl Texels {
    /// Squares of a pitch and a width in texels of 64, softer ones among them; nothing beyond `end` in u.
    fn new(size: usize, format: PixelFormat, [pitch, wide]: [usize; 2], end: f32) -> Texels {
        let value = |k: usize| {
            let at = [k % size, k / size].map(|x| x * 64 / size);
            let is_in = at.iter().all(|x| x % pitch < wide) && (k % size) as f32 <= end * size as f32;
            let soft = (at[0] / pitch + at[1] / pitch) % 3 == 0;
            if !is_in {
                0.0
            } else if soft {
                0.4
            } else {
                1.0
            }
        };
        Texels { size, values: (0..size * size).map(value).collect(), format }
    }

    fn set(&self, asset: &mut Asset, tile: usize, mask: bool) {
        let bytes: Vec<u8> = match self.format {
            PixelFormat::U8 => self.values.iter().map(|x| (255.0 * x) as u8).collect(),
            PixelFormat::U16 => {
                self.values.iter().flat_map(|x| ((65535.0 * x) as u16).to_ne_bytes()).collect()
            }
            _ => self.values.iter().flat_map(|x| x.to_ne_bytes()).collect(),
        };
        let layout = ImageLayout::packed(self.size as u32, self.size as u32, self.format);
        let image = Some(ImageView::new("rigidity", &bytes, layout).unwrap());
        let mut tile = asset.tile_mut(tile);
        if mask { tile.set_mask(image) } else { tile.set_rigidity(image) }.unwrap();
    }
}

/// Mesh and settings, set once, before the maps.
struct Case {
    settings: TileSettings,
    mask: Option<Texels>,
    vertex_mask: bool,
}

impl Case {
    fn make(&self, model: &Model, threads: u32) -> Asset {
        let mut asset = model.bare_on(&cpu(threads), Strided::from_slice(&model.rest));
        let free: Vec<f32> = (0..model.rest.len()).map(|v| if v % 9 == 4 { 0.0 } else { 1.0 }).collect();
        asset.set_vertex_mask(self.vertex_mask.then(|| Strided::from_slice(&free))).unwrap();
        for tile in 0..TILES {
            asset.tile_mut(tile).set_settings(&self.settings).unwrap();
            if let Some(mask) = &self.mask {
                mask.set(&mut asset, tile, true);
            }
        }
        asset
    }
}

/// All that a prepared asset is: the tiles' bytes, and facts about them.
fn prepared(asset: &mut Asset) -> Vec<(Vec<u8>, vrtm::TileInfo)> {
    let mut facts = |tile| (asset.tile_mut(tile).save().unwrap(), asset.tile_mut(tile).info().unwrap());
    (0..TILES).map(&mut facts).collect()
}

fn solved(asset: &mut Asset, model: &Model) -> Vec<[u32; 2]> {
    asset.solve(model.frame(2), &options(Quality::Draft)).unwrap();
    bits(asset)
}

/// A step of a history: sets the rigidity of an asset.
type Step<'a> = &'a dyn Fn(&mut Asset);

/// Sets one rigidity after the other. `kept` says of each but the first if the first tile keeps its blocks.
fn history(name: &str, case: &Case, steps: &[Step], kept: &[bool]) {
    let model = model();
    let mut asset = case.make(&model, 2);
    let mut last = None;
    for (n, step) in steps.iter().enumerate() {
        step(&mut asset);
        let mut fresh = case.make(&model, 1);
        step(&mut fresh);
        // A fresh asset is prepared as a whole.
        assert!(prepared(&mut asset) == prepared(&mut fresh), "{name}: map {n} is prepared in another way");
        assert!(
            solved(&mut asset, &model) == solved(&mut fresh, &model),
            "{name}: map {n} gives another result"
        );
        let grid = asset.result_inside(0).unwrap().grid().clone();
        if let Some(last) = last.replace(grid.clone()) {
            let movable = [&last, &grid].map(|grid| &grid.movable);
            assert_eq!(grid.has_blocks_of(&last), kept[n - 1], "{name}: map {n}, {movable:?}");
        }
        let held = asset.device().info().bytes_held;
        assert!(held >= fresh.device().info().bytes_held, "{name}: map {n} is not booked");
    }
    let device = asset.device().clone();
    drop(asset);
    assert_eq!(device.info().bytes_held, 0, "{name}: bytes are still booked");
}

fn settings(change: impl FnOnce(&mut TileSettings)) -> TileSettings {
    let mut settings =
        TileSettings { grid: [Some(48), Some(80)], seam_reach: 0.06, ..TileSettings::default() };
    change(&mut settings);
    settings
}

fn case(change: impl FnOnce(&mut TileSettings)) -> Case {
    Case { settings: settings(change), mask: None, vertex_mask: false }
}

/// Maps in which the same charts have rigidity, of several sizes and formats.
fn maps(case: &Case, name: &str, kept: bool) {
    let sizes = [
        (64, PixelFormat::U8, [9, 5]),
        (80, PixelFormat::U16, [12, 6]),
        (200, PixelFormat::F32, [8, 5]),
        (32, PixelFormat::F32, [10, 6]),
    ];
    let all = sizes.map(|(size, format, squares)| Texels::new(size, format, squares, 1.0));
    let [a, b, c, d] =
        all.map(|texels| move |asset: &mut Asset| (0..TILES).for_each(|tile| texels.set(asset, tile, false)));
    history(name, case, &[&a, &b, &c, &d, &a], &[kept; 4]);
}

#[test]
fn a_new_map_gives_what_a_fresh_asset_has() {
    maps(&case(|_| ()), "plain", true);
    maps(&case(|settings| settings.overlap = Overlap::FirstFace), "first face", true);
    maps(&case(|settings| settings.smoothness = 0.1), "smooth", true);
}

#[test]
fn it_does_where_charts_go_on_beyond_their_borders() {
    maps(&case(|settings| settings.seams = Seams::Continue), "continued", true);
    maps(&case(|settings| settings.open_borders = OpenBorders::Slide), "sliding", true);
    let both = |settings: &mut TileSettings| {
        (settings.seams, settings.open_borders) = (Seams::Continue, OpenBorders::Slide);
    };
    maps(&case(both), "both", true);
}

#[test]
fn it_does_under_masks() {
    let mask = Texels::new(70, PixelFormat::U8, [20, 17], 1.0);
    let mask = Texels { values: mask.values.iter().map(|x| x.ceil()).collect(), ..mask };
    maps(&Case { mask: Some(mask.clone()), ..case(|_| ()) }, "a mask", true);
    let continued = case(|settings| settings.seams = Seams::Continue);
    maps(&Case { mask: Some(mask), ..continued }, "a mask, continued", true);
    maps(&Case { vertex_mask: true, ..case(|_| ()) }, "a mask of vertices", true);
}

#[test]
fn it_does_where_all_has_to_be_prepared_anew() {
    maps(&case(|settings| settings.seams = Seams::Keep), "kept features", false);
    maps(&case(|settings| settings.orientation_density = 0.5), "density", false);
}

#[test]
fn it_does_where_a_chart_gains_or_loses_its_rigidity() {
    for seams in [Seams::Shut, Seams::Continue] {
        let case = case(|settings| settings.seams = seams);
        let set = |end: f32, squares: [usize; 2]| {
            move |asset: &mut Asset| {
                let texels = Texels::new(64, PixelFormat::U8, squares, end);
                (0..TILES).for_each(|tile| texels.set(asset, tile, false));
            }
        };
        // In the second and the third map the second chart of each tile has none.
        let steps: [Step; 5] = [
            &set(1.0, [9, 5]),
            &set(0.4, [9, 5]),
            &set(0.4, [12, 7]),
            &set(1.0, [12, 7]),
            &|asset: &mut Asset| (0..TILES).for_each(|tile| asset.tile_mut(tile).set_rigidity(None).unwrap()),
        ];
        // A collar of the second chart shows the rigidity of the first one.
        let shows = seams == Seams::Continue;
        history("charts without", &case, &steps, &[shows, true, shows, false]);
    }
}

#[test]
fn it_does_with_the_rigidity_of_vertices() {
    for seams in [Seams::Shut, Seams::Continue] {
        let case = case(|settings| settings.seams = seams);
        let set = |step: usize| {
            move |asset: &mut Asset| {
                let count = asset.info().vertices as usize;
                let number = |v: usize| if v % 7 < step { 1.0 } else { 0.0 };
                let rigidity: Vec<f32> = (0..count).map(number).collect();
                asset.set_vertex_rigidity(Some(Strided::from_slice(&rigidity))).unwrap();
            }
        };
        history("vertices", &case, &[&set(2), &set(3), &set(4)], &[true, true]);
    }
}

#[test]
fn it_does_where_the_map_decides_on_the_grid() {
    let case = case(|settings| settings.grid = [None; 2]);
    let set = |squares: [usize; 2], most: f32| {
        move |asset: &mut Asset| {
            let mut texels = Texels::new(256, PixelFormat::U8, squares, 1.0);
            texels.values.iter_mut().for_each(|value| *value *= most);
            (0..TILES).for_each(|tile| texels.set(asset, tile, false));
        }
    };
    let steps: [Step; 4] =
        [&set([20, 15], 1.0), &set([20, 15], 0.8), &set([12, 4], 1.0), &set([20, 15], 1.0)];
    history("chosen", &case, &steps, &[true, false, false]);
}

/// A chart whose rigidity is what it was keeps its result.
#[test]
fn charts_that_a_new_map_does_not_change_are_not_solved_again() {
    let (model, case) = (model(), case(|_| ()));
    let mut asset = case.make(&model, 1);
    let mut texels = Texels::new(64, PixelFormat::U8, [9, 5], 1.0);
    texels.set(&mut asset, 0, false);
    solved(&mut asset, &model);
    // The second chart of the tile begins at u = 0.55.
    for row in texels.values.chunks_exact_mut(64) {
        row[40..50].iter_mut().for_each(|value| *value = 0.7);
    }
    texels.set(&mut asset, 0, false);
    solved(&mut asset, &model);
    let report = asset.tile(0).report().unwrap();
    assert!(report.charts_active == 1 && report.charts_reused >= 1, "{report:?}");
}
