//! How deep inside of each chart a node of the surface lies, from 0 where the chart's collar ends to 1 on the chart itself: the
//! measure of a chart's part in the blend there. On a rigid feature it is the same everywhere, so that the feature moves as one
//! piece; around features it changes little faster than elsewhere.

use glam::DVec2;

use super::lattice::cells;
use super::places::{OUTSIDE, OnChart, Place, Places, on_surface, seen_by};
use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::grid::Grid;
use vrtm_core::grid::codes::decode_rigidity;
use vrtm_core::grid::planes::{NODES, SIDE, node_at};
use vrtm_core::mesh::NONE;
use vrtm_core::mesh::hash::{Table, enter};
use vrtm_core::mesh::triangle::barycentrics;

/// The rigidity of a node of a feature.
const RIGID: f32 = 0.5;
/// The greatest change of a depth beside features, relative to that along a collar: from 1 to 0 over the reach.
const SLOPE: f64 = 1.5;

/// Most rounds in which depths spread by a node or more.
const MOST_ROUNDS: f32 = 1000.0;

/// The depth of a chart at a node.
#[derive(Clone, Copy, Debug)]
struct Depth {
    /// Four times the chart's number among those of all tiles; plus 1 for the collar of the node's own chart, which goes on in
    /// itself; plus 2 for the mirror image of the chart, which has the node where the chart has the node's image.
    key: u32,
    depth: f32,
}

impl Depth {
    fn is_image(&self) -> bool {
        self.key & 2 != 0
    }
}

/// A tile's nodes.
#[derive(Debug, Default)]
struct Nodes {
    size: [usize; 2],
    /// Per node of the grid, its number in `Depths`, or `NONE` outside of charts.
    number: Vec<u32>,
}

/// The depths at the nodes of charts.
#[derive(Debug)]
pub struct Depths {
    tiles: Vec<Nodes>,
    /// Per tile, the number of its first chart.
    first_chart: Vec<u32>,
    /// The index of each node's first entry, followed by the number of entries. A node's own chart comes first.
    starts: Vec<u32>,
    entries: Vec<Depth>,
}

/// A node of a chart.
struct Node {
    tile: u32,
    triangle: u32,
    at: [usize; 2],
    rigid: bool,
}

impl Depths {
    /// The depths at the nodes of the grids of some tiles; those of tiles without one are 1 on the chart itself.
    pub fn new(places: &Places, grids: &[Option<&Grid>], reaches: &[f64]) -> Depths {
        let mut charts = 0;
        let first_chart: Vec<u32> = places
            .tiles
            .iter()
            .map(|tile| {
                charts += tile.charts.len() as u32;
                charts - tile.charts.len() as u32
            })
            .collect();
        let mut depths = Depths { tiles: Vec::new(), first_chart, starts: Vec::new(), entries: Vec::new() };
        let mut nodes: Vec<Node> = Vec::new();
        let mut beyond: Vec<(u32, Place)> = Vec::new();
        for (t, grid) in grids.iter().enumerate() {
            depths.add_tile(places, t as u32, *grid, &mut nodes, &mut beyond);
        }
        depths.starts.push(depths.entries.len() as u32);
        let links: Vec<[u32; 2]> = beyond
            .into_iter()
            .filter_map(|(node, place)| Some([node, depths.nearest(places, place)?]))
            .collect();
        // Per tile and axis, the greatest change from node to node.
        let slopes = grids.iter().zip(reaches).map(|(grid, reach)| {
            let of = |cells: usize| (SLOPE / (reach * cells as f64)) as f32;
            grid.map_or([1.0; 2], |grid| [of(grid.levels[0].nx), of(grid.levels[0].ny)])
        });
        depths.settle(&nodes, &links, &slopes.collect::<Vec<_>>());
        depths
    }

    /// Adds the nodes of a tile's charts with their depths by distance, and for those at a border the places that lie one node
    /// further.
    fn add_tile(
        &mut self,
        places: &Places,
        index: u32,
        grid: Option<&Grid>,
        nodes: &mut Vec<Node>,
        beyond: &mut Vec<(u32, Place)>,
    ) {
        let Some(grid) = grid else { return self.tiles.push(Nodes::default()) };
        let (tile, level) = (&*places.tiles[index as usize], &grid.levels[0]);
        let size = [level.nx + 1, level.ny + 1];
        let mut number = vec![NONE; size[0] * size[1]];
        let first = nodes.len();
        for (b, block) in level.blocks.list.iter().enumerate() {
            for s in 0..NODES {
                let triangle = grid.triangle[b][s];
                let (i, j) = node_at(s);
                let at = [block.x as usize * SIDE + i, block.y as usize * SIDE + j];
                if triangle as usize >= tile.own() || at[0] >= size[0] || at[1] >= size[1] {
                    continue;
                }
                let own = tile.chart_of_triangle(triangle);
                let slot = &mut number[at[1] * size[0] + at[0]];
                if own != block.chart || *slot != NONE {
                    continue;
                }
                *slot = nodes.len() as u32;
                let rigid = decode_rigidity(level.rigidity[b][s]) > RIGID;
                nodes.push(Node { tile: index, triangle, at, rigid });
                self.starts.push(self.entries.len() as u32);
                let uv = DVec2::new(at[0] as f64, at[1] as f64) / cells(level);
                let place = Place { tile: index, triangle, uv, image: false };
                let own = 4 * (self.first_chart[index as usize] + own);
                self.entries.push(Depth { key: own, depth: 1.0 });
                for on in sheets(places, place).into_iter().filter(|on| on.is_collar) {
                    let depth = match on.image {
                        true => beside_mirror(places, &on, cells(level)),
                        false => depth_of(places, &on),
                    };
                    self.entries.push(Depth { key: self.key(&on, own), depth });
                }
            }
        }
        // Neighbours in the collar.
        for (k, node) in nodes[first..].iter().enumerate() {
            let chart = tile.chart_of_triangle(node.triangle);
            for (dx, dy) in [(1, 0), (0, 1), (-1, 0), (0, -1)] {
                let (x, y) = (node.at[0] as i64 + dx, node.at[1] as i64 + dy);
                let b = level.blocks.find(chart, x >> 4, y >> 4);
                if b == NONE || x < 0 || y < 0 {
                    continue;
                }
                let s = vrtm_core::grid::planes::slot((x & 15) as usize, (y & 15) as usize);
                let triangle = grid.triangle[b as usize][s];
                if triangle != NONE && triangle as usize >= tile.own() && !tile.is_image(triangle) {
                    let uv = DVec2::new(x as f64, y as f64) / cells(level);
                    beyond.push(((first + k) as u32, on_surface(tile, index, triangle, uv)));
                }
            }
        }
        self.tiles.push(Nodes { size, number });
    }

    /// The key of a chart at a place on the chart with the key `own`.
    fn key(&self, on: &OnChart, own: u32) -> u32 {
        let key = 4 * (self.first_chart[on.tile as usize] + on.chart);
        if on.image { key + 2 } else { key + u32::from(key == own && on.is_collar) }
    }

    /// The node of the same chart that is nearest to a place on it.
    fn nearest(&self, places: &Places, place: Place) -> Option<u32> {
        let tile = &self.tiles[place.tile as usize];
        if tile.number.is_empty() {
            return None;
        }
        let chart = self.first_chart[place.tile as usize]
            + places.tiles[place.tile as usize].chart_of_triangle(place.triangle);
        let last = DVec2::new(tile.size[0] as f64, tile.size[1] as f64) - 1.0;
        let at = (place.uv * last).round().clamp(DVec2::ZERO, last);
        let n = tile.number[at.y as usize * tile.size[0] + at.x as usize];
        (n != NONE && self.own(n) == 4 * chart).then_some(n)
    }

    /// The key of a node's own chart.
    fn own(&self, n: u32) -> u32 {
        self.entries[self.starts[n as usize] as usize].key
    }

    fn of(&self, n: u32) -> &[Depth] {
        &self.entries[self.starts[n as usize] as usize..self.starts[n as usize + 1] as usize]
    }

    /// A chart's depth at a node; 0 where its collar does not reach.
    fn depth(&self, n: u32, key: u32) -> f32 {
        self.of(n).iter().find(|entry| entry.key == key).map_or(0.0, |entry| entry.depth)
    }

    /// Makes depths the same on each feature, and lets them change slowly beside features.
    fn settle(&mut self, nodes: &[Node], links: &[[u32; 2]], slopes: &[[f32; 2]]) {
        let around = |n: usize, dx: i64, dy: i64| {
            let Node { tile, at, .. } = &nodes[n];
            let tile = &self.tiles[*tile as usize];
            let (x, y) = (at[0] as i64 + dx, at[1] as i64 + dy);
            if x < 0 || y < 0 || x >= tile.size[0] as i64 || y >= tile.size[1] as i64 {
                return None;
            }
            let other = tile.number[y as usize * tile.size[0] + x as usize];
            let same = |other: u32| self.own(other) == self.own(n as u32);
            (other != NONE && same(other)).then_some(other)
        };
        // Links of both directions, sorted by node.
        let mut over: Vec<[u32; 2]> = links.iter().flat_map(|&[a, b]| [[a, b], [b, a]]).collect();
        over.sort_unstable();
        over.dedup();
        let mut edges: Vec<[u32; 2]> = Vec::with_capacity(4 * nodes.len());
        for n in 0..nodes.len() {
            for (dx, dy) in [(1, 0), (0, 1)] {
                edges.extend(around(n, dx, dy).map(|other| [n as u32, other]));
            }
        }
        let within = edges.len();
        edges.extend(over.into_iter().filter(|[a, b]| a < b));
        // Features: connected rigid nodes.
        let mut parents: Vec<u32> = (0..nodes.len() as u32).collect();
        for &[a, b] in edges.iter().filter(|e| e.iter().all(|&n| nodes[n as usize].rigid)) {
            let (a, b) = (root(&mut parents, a), root(&mut parents, b));
            parents[a.max(b) as usize] = a.min(b);
        }
        // Features over a seam of a chart with itself: what is the chart on one side is its collar on the other.
        let mut turns: Vec<bool> = zeroed(nodes.len());
        for &[a, b] in &edges[within..] {
            let is_rigid = nodes[a as usize].rigid && nodes[b as usize].rigid;
            turns[root(&mut parents, a) as usize] |= is_rigid && self.own(a) == self.own(b);
        }
        let mut sizes: Vec<u32> = zeroed(nodes.len());
        let mut least: Table<(u32, u32), (f32, u32)> = Table::default();
        for n in (0..nodes.len() as u32).filter(|&n| nodes[n as usize].rigid) {
            let feature = root(&mut parents, n);
            sizes[feature as usize] += 1;
            for entry in self.of(n).iter().filter(|entry| !entry.is_image()) {
                let (depth, count) = least.get(&(feature, entry.key)).copied().unwrap_or((f32::INFINITY, 0));
                enter(&mut least, (feature, entry.key), (depth.min(entry.depth), count + 1));
            }
        }
        // A feature that no chart has whole keeps its depths by distance.
        let of_feature = |feature: u32, key: u32| {
            let of_key = |key: u32| {
                let found = least.get(&(feature, key)).filter(|(_, count)| *count == sizes[feature as usize]);
                found.map_or(0.0, |(depth, _)| *depth)
            };
            if turns[feature as usize] { of_key(key).min(of_key(key ^ 1)) } else { of_key(key) }
        };
        let mut is_whole: Vec<bool> = zeroed(nodes.len());
        for n in (0..nodes.len() as u32).filter(|&n| nodes[n as usize].rigid) {
            let feature = root(&mut parents, n);
            let mut of_charts = self.of(n).iter().filter(|entry| !entry.is_image());
            let whole = of_charts.any(|entry| of_feature(feature, entry.key) > 0.0);
            is_whole[feature as usize] |= whole;
        }
        for n in (0..nodes.len() as u32).filter(|&n| nodes[n as usize].rigid) {
            let feature = root(&mut parents, n);
            if is_whole[feature as usize] {
                let range = self.starts[n as usize] as usize..self.starts[n as usize + 1] as usize;
                for entry in self.entries[range].iter_mut().filter(|entry| !entry.is_image()) {
                    entry.depth = of_feature(feature, entry.key);
                }
            }
        }
        let least = slopes.as_flattened().iter().copied().fold(1.0, f32::min);
        let rounds = (1.0 / least).ceil().min(MOST_ROUNDS) as usize + 1;
        let slope = |[a, b]: [u32; 2]| {
            let [of_a, of_b] = [a, b].map(|n| slopes[nodes[n as usize].tile as usize]);
            let along = nodes[a as usize].at[0] == nodes[b as usize].at[0];
            if nodes[a as usize].tile == nodes[b as usize].tile && of_a == of_b {
                of_a[usize::from(along)]
            } else {
                of_a[0].min(of_a[1]).min(of_b[0]).min(of_b[1])
            }
        };
        for _ in 0..rounds {
            let mut changed = false;
            for k in 0..2 * edges.len() {
                // Forwards, then backwards.
                let e = if k < edges.len() { k } else { 2 * edges.len() - 1 - k };
                let [a, b] = edges[e];
                // Over a seam of a chart with itself, the chart and its collar change places.
                let (own, turns) = (self.own(a), e >= within && self.own(a) == self.own(b));
                for [from, to] in [[a, b], [b, a]] {
                    if nodes[to as usize].rigid {
                        continue;
                    }
                    for e in self.starts[to as usize]..self.starts[to as usize + 1] {
                        let entry = self.entries[e as usize];
                        if entry.is_image() {
                            continue;
                        }
                        let Depth { key, depth } = entry;
                        let swapped = if turns && key >> 1 == own >> 1 { key ^ 1 } else { key };
                        let bound = self.depth(from, swapped) + slope([a, b]);
                        if bound < depth {
                            self.entries[e as usize].depth = bound;
                            changed = true;
                        }
                    }
                }
            }
            if !changed {
                break;
            }
        }
    }

    /// The parts that the charts that have a place take in the blend, in their order.
    pub(super) fn parts(&self, places: &Places, place: Place, sheets: &[OnChart]) -> Vec<f32> {
        let own = 4
            * (self.first_chart[place.tile as usize]
                + places.tiles[place.tile as usize].chart_of_triangle(place.triangle));
        let keys: Vec<u32> = sheets.iter().map(|on| self.key(on, own)).collect();
        let tile = &self.tiles[place.tile as usize];
        let mut weights: Vec<f32> = vec![0.0; keys.len()];
        let mut whole = 0.0;
        if !tile.number.is_empty() {
            let at = place.uv * (DVec2::new(tile.size[0] as f64, tile.size[1] as f64) - 1.0);
            let cell = at.floor();
            let part = at - cell;
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let (x, y) = (cell.x as i64 + dx, cell.y as i64 + dy);
                if x < 0 || y < 0 || x >= tile.size[0] as i64 || y >= tile.size[1] as i64 {
                    continue;
                }
                let n = tile.number[y as usize * tile.size[0] + x as usize];
                if n == NONE || self.own(n) != own {
                    continue;
                }
                let [wx, wy] = [(dx, part.x), (dy, part.y)].map(|(d, p)| if d == 1 { p } else { 1.0 - p });
                let weight = (wx * wy) as f32;
                whole += weight;
                for (sum, &key) in weights.iter_mut().zip(&keys) {
                    *sum += weight * self.depth(n, key);
                }
            }
        }
        if whole <= 0.0 {
            // Beside all nodes of its chart, the chart alone counts.
            weights.iter_mut().zip(&keys).for_each(|(w, &key)| *w = f32::from(u8::from(key == own)));
            return weights;
        }
        weights.iter_mut().for_each(|w| *w = smooth(*w / whole));
        let sum: f32 = weights.iter().sum();
        if sum > 0.0 {
            weights.iter_mut().for_each(|w| *w /= sum);
        } else {
            weights.iter_mut().zip(&keys).for_each(|(w, &key)| *w = f32::from(u8::from(key == own)));
        }
        weights
    }
}

/// The charts that have a place: the one on which it lies first, and those with a collar there, once each.
pub(super) fn sheets(places: &Places, place: Place) -> Vec<OnChart> {
    let mut all: Vec<OnChart> = Vec::with_capacity(4);
    for &(k, t) in [(place.tile, place.triangle)].iter().chain(places.of(place.tile, place.triangle)) {
        let other = &places.tiles[k as usize];
        let Some((depth, uv)) = seen_by(other, k, t, place) else { continue };
        let is_collar = other.source(t as usize).is_some();
        let (chart, image) = (other.chart_of_triangle(t), other.is_image(t));
        let on = OnChart { tile: k, triangle: t, chart, is_collar, image, depth, uv };
        match all.iter_mut().find(|known| known.sheet() == on.sheet()) {
            Some(known) if known.depth >= depth => {}
            Some(known) => *known = on,
            None if depth >= -OUTSIDE || !is_collar => all.push(on),
            None => {}
        }
    }
    all
}

/// How much of its collar is left around a place, by distance; 1 on the chart itself.
pub(super) fn depth_of(places: &Places, on: &OnChart) -> f32 {
    let tile = &places.tiles[on.tile as usize];
    tile.source(on.triangle as usize).map_or(1.0, |source| {
        let [s, r] = barycentrics(tile.triangles[on.triangle as usize].uv, on.uv).map(|x| x as f32);
        let [a, b, c] = source.depth;
        (a + s * (b - a) + r * (c - a)).clamp(0.0, 1.0)
    })
}

/// Where this many cells from an open border, a chart and its image are no longer blended: the solve holds texture at the
/// border, so that only a rest is left there.
const BESIDE_MIRROR: f64 = 2.0;

/// How near a place is to the open border beyond which a chart has its image there: 1 at the border.
fn beside_mirror(places: &Places, on: &OnChart, cells: DVec2) -> f32 {
    let tile = &places.tiles[on.tile as usize];
    tile.source(on.triangle as usize).map_or(1.0, |source| {
        let [s, r] = barycentrics(tile.triangles[on.triangle as usize].uv, on.uv).map(|x| x as f32);
        let [a, b, c] = source.distance;
        let distance = f64::from(a + s * (b - a) + r * (c - a)) * cells.min_element();
        (1.0 - distance / BESIDE_MIRROR).clamp(0.0, 1.0) as f32
    })
}

fn root(parents: &mut [u32], mut a: u32) -> u32 {
    while parents[a as usize] != a {
        parents[a as usize] = parents[parents[a as usize] as usize];
        a = parents[a as usize];
    }
    a
}

/// From 0 to 1, level at both ends.
pub(super) fn smooth(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}
