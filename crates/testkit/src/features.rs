//! The error of each painted feature, in f64, from the mesh, the maps and the warps alone.
//!
//! A feature is a connected set of rigid nodes of the grids: neighbours with the surface between them, and nodes that
//! face each other across a seam. Its error is the root mean square of |l / L - 1| over all of its edges, those at a
//! chart's border included; l is an edge's chord in the pose, from W(a) to W(b), and L its chord at rest.

mod beyond;
mod charts;
pub mod dense;
mod gaps;

use std::collections::HashMap;

use crate::asset::CollarOfChart;
use crate::asset::Lab as _;
use vrtm::{Asset, OpenBorders, Seams, SolveOptions, Strided};

use crate::files::assets;
use crate::model::{Model, change_all};
use crate::scenes::{self, TileMaps as Maps};
use crate::warp::Warp;
use beyond::Beyond;
use charts::{Border, Charts, distance, interpolate};
pub use gaps::gaps;

/// Place of a feature: in the order of preference, if it is at borders of several kinds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// No node is within a cell of a chart's border.
    Inner,
    /// At a border beyond which the mesh has no face.
    Open,
    /// At a border beyond which the surface goes on, elsewhere in the UV plane.
    Seam,
}

#[derive(Clone, Copy, Debug)]
pub struct Feature {
    pub kind: Kind,
    /// The error with the original UVs, and with the warp.
    pub before: f64,
    pub after: f64,
    /// One of its nodes: the number of the map, and the place in it, 0..1.
    pub at: (usize, [f64; 2]),
}

/// The scenes and assets that are measured, each in one frame (from 1) and on all of its tiles.
pub const CASES: [(&str, usize); 15] = [
    ("squash", 1),
    ("squash to 40 %", 1),
    ("bulge", 1),
    ("pinch", 1),
    ("shear", 1),
    ("torus", 1),
    ("strips", 1),
    ("mug_to_jug", 5),
    ("creature", 4),
    ("arm", 3),
    ("mh_face", 1),
    ("spot", 2),
    ("cesium_man", 3),
    ("fox", 3),
    ("ict_inner", 5),
];

/// All scenes, and the assets that are there.
pub fn models() -> Vec<Model> {
    let mut models: Vec<Model> =
        scenes::NAMES.iter().filter_map(|name| scenes::by_name(name)).map(Model::from).collect();
    let crowded = Model::from(scenes::analytic::squash(0.4));
    models.push(Model { name: "squash to 40 %".into(), ..crowded });
    models.extend(assets());
    models
}

/// The root mean square of some numbers; 0 of none.
pub fn rms(numbers: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = numbers.fold((0.0, 0.0f64), |(sum, count), x| (sum + x * x, count + 1.0));
    (sum / count.max(1.0)).sqrt()
}

/// Settings at the borders of charts.
pub type Borders = (Seams, OpenBorders);

/// Nothing moves there.
pub const STILL: Borders = (Seams::Shut, OpenBorders::Fixed);

pub fn set_borders(asset: &mut Asset, (seams, open_borders): Borders) {
    change_all(asset, |settings| (settings.seams, settings.open_borders) = (seams, open_borders));
}

/// An asset of a model, solved for a pose on a CPU.
pub fn solve(
    model: &Model,
    pose: &[[f32; 3]],
    threads: u32,
    grid: u32,
    borders: Borders,
    options: &SolveOptions,
) -> Asset {
    let mut asset = model.asset(threads, grid);
    set_borders(&mut asset, borders);
    asset.solve(Strided::from_slice(pose), options).unwrap();
    asset
}

/// The features of a model in a pose, with the last result of an asset of it.
pub fn of_asset(model: &Model, pose: &[[f32; 3]], asset: &Asset) -> Vec<Feature> {
    let (warps, collars) = warps(model, asset);
    features(model, pose, &warps, &collars)
}

/// The warps of a model's maps, in their order, and what lies beyond the seams of their charts.
fn warps(model: &Model, asset: &Asset) -> (Vec<Warp>, Vec<Vec<CollarOfChart>>) {
    let tiles = model.maps.iter().map(|maps| asset.find_tile(maps.udim).unwrap());
    tiles.map(|tile| (Warp::of(asset, tile), asset.collars(tile).unwrap())).unzip()
}

/// As `of_asset`, but at the texels of the maps in place of the nodes of the grids, which may be much coarser. Charts
/// must end at their borders.
pub fn at_texels(model: &Model, pose: &[[f32; 3]], asset: &Asset) -> Vec<Feature> {
    let of = |maps: &Maps| {
        let warp = Warp::of(asset, asset.find_tile(maps.udim).unwrap());
        warp.on_grid([maps.width as usize, maps.height as usize])
    };
    let warps: Vec<Warp> = model.maps.iter().map(of).collect();
    let collars: Vec<Vec<CollarOfChart>> = warps.iter().map(|_| Vec::new()).collect();
    features(model, pose, &warps, &collars)
}

/// Features with fewer edges are left out.
const LEAST_EDGES: usize = 12;

/// A node of a grid: the warp's index, and the node's in it.
type Node = (usize, usize);

/// The features of a model in a pose; `warps` are those of its maps, in their order, and `collars` what lies beyond the
/// seams of their charts, where redirections lead over them.
fn features(
    model: &Model,
    pose: &[[f32; 3]],
    warps: &[Warp],
    collars: &[Vec<CollarOfChart>],
) -> Vec<Feature> {
    let charts = Charts::new(model, warps);
    let beyond = Beyond::new(&charts, warps, collars);
    let mut rigid: HashMap<Node, usize> = HashMap::new();
    let mut nodes = Vec::new();
    for (w, (maps, warp)) in model.maps.iter().zip(warps).enumerate() {
        for n in 0..warp.u.len() {
            let at = [n % (warp.nx + 1), n / (warp.nx + 1)];
            if charts.under[w][n].is_some() && rigidity(maps, warp, at) > 0.5 {
                rigid.insert((w, n), nodes.len());
                nodes.push((w, n));
            }
        }
    }
    // On the surface: at rest, in the pose with the original UVs, and with the warp.
    let places: Vec<[[f64; 3]; 3]> = nodes
        .iter()
        .map(|&(w, n)| {
            let (warp, home) = (&warps[w], charts.under[w][n].unwrap());
            let (i, j) = (n % (warp.nx + 1), n / (warp.nx + 1));
            let (at, to) = ([i as f64, j as f64], warp.node(i, j));
            [
                interpolate(&charts.triangles[home], &model.rest, at),
                interpolate(&charts.triangles[home], pose, at),
                beyond.position(&charts, w, home, to, pose),
            ]
        })
        .collect();

    let mut sets = Sets((0..nodes.len()).collect());
    let mut edges = Vec::new();
    for (a, &(w, n)) in nodes.iter().enumerate() {
        let width = warps[w].nx + 1;
        for (di, dj) in [(1, 0), (0, 1), (1, 1), (-1, 1)] {
            let (i, j) = ((n % width) as i64 + di, n / width + dj);
            let Some(&b) = rigid.get(&(w, j * width + i.max(0) as usize)) else { continue };
            if i < 0
                || i >= width as i64
                || !charts.goes_on(charts.under[w][n].unwrap(), [i as f64, j as f64])
            {
                continue;
            }
            sets.join(a, b);
            edges.push([a, b]);
        }
    }
    let mut kinds = vec![Kind::Inner; nodes.len()];
    for border in &charts.borders {
        let Border { node, beyond } = border;
        let Some(&a) = rigid.get(node) else { continue };
        kinds[a] = kinds[a].max(if beyond.is_some() { Kind::Seam } else { Kind::Open });
        for b in beyond.iter().flatten().filter_map(|node| rigid.get(node)) {
            sets.join(a, *b);
        }
    }

    let mut found: HashMap<usize, (Kind, usize, [f64; 2])> = HashMap::new();
    for [a, b] in edges {
        let (rest, before, after) = {
            let length = |k: usize| distance(places[a][k], places[b][k]);
            (length(0), length(1), length(2))
        };
        if rest > 0.0 {
            let (_, count, squares) = found.entry(sets.root(a)).or_insert((Kind::Inner, 0, [0.0; 2]));
            *count += 1;
            squares[0] += (before / rest - 1.0).powi(2);
            squares[1] += (after / rest - 1.0).powi(2);
        }
    }
    for (a, kind) in kinds.into_iter().enumerate() {
        if let Some(feature) = found.get_mut(&sets.root(a)) {
            feature.0 = feature.0.max(kind);
        }
    }
    let of = |root: usize, (kind, count, squares): (Kind, usize, [f64; 2])| {
        let [before, after] = squares.map(|sum| (sum / count as f64).sqrt());
        let (w, n) = nodes[root];
        let [nx, ny] = [warps[w].nx, warps[w].ny];
        let at = (w, [(n % (nx + 1)) as f64 / nx as f64, (n / (nx + 1)) as f64 / ny as f64]);
        (count >= LEAST_EDGES).then_some(Feature { kind, before, after, at })
    };
    let mut roots: Vec<_> = found.into_iter().collect();
    roots.sort_by_key(|(root, _)| *root);
    roots.into_iter().filter_map(|(root, feature)| of(root, feature)).collect()
}

/// The mean rigidity of the texels in a cell around a node.
fn rigidity(maps: &Maps, warp: &Warp, [i, j]: [usize; 2]) -> f64 {
    const SAMPLES: usize = 4;
    let texel = |at: f64, side: u32| (at * f64::from(side)).clamp(0.0, f64::from(side) - 1.0) as usize;
    let offset = |k: usize| (k as f64 + 0.5) / SAMPLES as f64 - 0.5;
    let mut sum = 0.0;
    for k in 0..SAMPLES * SAMPLES {
        let u = (i as f64 + offset(k % SAMPLES)) / warp.nx as f64;
        let v = (j as f64 + offset(k / SAMPLES)) / warp.ny as f64;
        let (x, y) = (texel(u, maps.width), texel(1.0 - v, maps.height));
        sum += f64::from(maps.rigidity[y * maps.width as usize + x]) / 255.0;
    }
    sum / (SAMPLES * SAMPLES) as f64
}

/// Disjoint sets of nodes.
struct Sets(Vec<usize>);

impl Sets {
    fn root(&mut self, mut a: usize) -> usize {
        while self.0[a] != a {
            self.0[a] = self.0[self.0[a]];
            a = self.0[a];
        }
        a
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b);
    }
}

/// Row of a table for the features of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    pub count: usize,
    /// Number of features with an error over 0.05: before, and after.
    pub bad: [usize; 2],
    /// Number of features whose error rose by more than 0.02.
    pub worse: usize,
    /// Mean errors: before, and after.
    pub mean: [f64; 2],
}

impl Summary {
    pub fn of(features: &[Feature], kind: Kind) -> Summary {
        let mut summary = Summary::default();
        for feature in features.iter().filter(|feature| feature.kind == kind) {
            summary.count += 1;
            summary.worse += usize::from(feature.after > feature.before + 0.02);
            for (k, error) in [feature.before, feature.after].into_iter().enumerate() {
                summary.bad[k] += usize::from(error > 0.05);
                summary.mean[k] += error;
            }
        }
        summary.mean = summary.mean.map(|sum| sum / summary.count.max(1) as f64);
        summary
    }
}
