//! The error of each painted feature, without the warp and with it. A feature is a connected set of rigid nodes of one
//! chart; its error is the root mean square of the strain over all of its edges, those that cannot move included.

use glam::DVec2;

use crate::allocation::{Vec, vec};
use crate::grid::coverage::NodeMaps;
use crate::mesh::NONE;
use crate::report::{StrainReport, WorstFeature, report};
use crate::sets::root;

/// Rigid nodes have more than this share of the tile's largest rigidity.
const RIGID: f32 = 0.5;
/// Sets with fewer edges are too small to be measured.
const LEAST_EDGES: u32 = 12;
/// A feature whose error rises by more than this is worse than without the warp.
const WORSE: f64 = 0.02;
/// A feature with an error over this is visibly out of shape.
const STRAINED: f64 = 0.05;

/// Per node, true if it is covered and rigid.
pub(super) fn rigid(maps: &NodeMaps) -> Vec<bool> {
    let least = RIGID * maps.rigidity.iter().fold(0.0, |largest: f32, &value| largest.max(value));
    maps.rigidity.iter().zip(&maps.triangle).map(|(&value, &home)| value > least && home != NONE).collect()
}

/// The edges that a node owns.
#[derive(Clone, Copy, Default)]
struct Sums {
    edges: u32,
    /// Sums of the squares of their strains: before the warp, and after it.
    squares: [f64; 2],
}

impl Sums {
    fn errors(&self) -> [f64; 2] {
        self.squares.map(|squares| (squares / f64::from(self.edges)).sqrt())
    }
}

/// Sums over a feature.
#[derive(Default)]
struct Feature {
    first: usize,
    sums: Sums,
    nodes: u32,
    places: DVec2,
    at_border: bool,
}

/// Nodes, joined by their edges to features.
pub struct Features {
    /// Per node, a node before it in the same feature, or itself.
    parents: Vec<u32>,
    sums: Vec<Sums>,
}

impl Features {
    pub fn new(nodes: usize) -> Features {
        Features { parents: (0..nodes as u32).collect(), sums: vec![Sums::default(); nodes] }
    }

    /// Adds an edge with its strain, before the warp and after it.
    pub fn add(&mut self, [a, b]: [usize; 2], strain: [f64; 2]) {
        let Sums { edges, squares } = &mut self.sums[a];
        *edges += 1;
        squares.iter_mut().zip(strain).for_each(|(sum, strain)| *sum += strain * strain);
        let [a, b] = [a, b].map(|node| root(&mut self.parents, node as u32));
        self.parents[a.max(b) as usize] = a.min(b);
    }

    /// Adds the features to the report. `origin` is the tile's lower corner.
    pub fn report(mut self, maps: &NodeMaps, origin: DVec2, others: StrainReport) -> StrainReport {
        let cells = DVec2::new(maps.nx as f64, maps.ny as f64);
        let mut found: Vec<Feature> = Vec::new();
        // A feature's first node comes first, and names the feature to the others.
        let mut numbers = vec![0u32; self.sums.len()];
        for n in 0..self.sums.len() {
            let (root, own) = (root(&mut self.parents, n as u32) as usize, self.sums[n]);
            if root == n {
                if own.edges == 0 {
                    continue;
                }
                numbers[n] = found.len() as u32;
                found.push(Feature { first: n, ..Feature::default() });
            }
            let Feature { sums, nodes, places, at_border, .. } = &mut found[numbers[root] as usize];
            sums.edges += own.edges;
            (0..2).for_each(|k| sums.squares[k] += own.squares[k]);
            *nodes += 1;
            *places += DVec2::new((n % (maps.nx + 1)) as f64, (n / (maps.nx + 1)) as f64);
            *at_border |= !maps.interior[n];
        }
        found.retain(|feature| feature.sums.edges >= LEAST_EDGES);
        let count = |which: &dyn Fn([f64; 2]) -> bool| {
            found.iter().filter(|feature| which(feature.sums.errors())).count() as u32
        };
        let rise = |feature: &Feature| {
            let [before, after] = feature.sums.errors();
            after - before
        };
        let mut report = report!(others, {
            features: found.len() as u32,
            features_worse: found.iter().filter(|feature| rise(feature) > WORSE).count() as u32,
            features_strained_before: count(&|[before, _]| before > STRAINED),
            features_strained_after: count(&|[_, after]| after > STRAINED),
        });
        // Of equals, the first one stays first.
        found.sort_unstable_by(|a, b| rise(b).total_cmp(&rise(a)).then(a.first.cmp(&b.first)));
        for (worst, feature) in report.worst.iter_mut().zip(&found).take(report.features_worse as usize) {
            let [before, after] = feature.sums.errors().map(|error| error as f32);
            let centre = origin + feature.places / f64::from(feature.nodes) / cells;
            *worst = WorstFeature {
                uv: centre.as_vec2().into(),
                area: (f64::from(feature.nodes) / cells.element_product()) as f32,
                before,
                after,
                at_border: feature.at_border,
            };
        }
        report
    }
}
