//! The depth of a node of the surface in each chart, from 0 where the chart's collar ends to 1 on the chart itself: the
//! measure of a chart's part in the blend there. On a rigid feature it is the same everywhere, so that the
//! feature moves as one piece; around features it changes little faster than elsewhere.

use std::mem::replace;
use std::sync::Arc;

use glam::DVec2;

use super::nodes::{FAR, Kind, Links, Node, Nodes, along_v, beside, kinds_of, node_of, uv_of};
use super::places::{OnChart, Place, Places, beside_mirror, depth_of, sheets};
use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::{NODES, Plane};
use vrtm_core::mesh::hash::{Table, enter};
use vrtm_core::mesh::{NONE, TileMesh};
use vrtm_core::sets::root;
use vrtm_core::team::Team;

/// The greatest change of a depth beside features, relative to that along a collar: from 1 to 0 over the reach.
const SLOPE: f64 = 1.5;

/// Most rounds in which depths spread by a node or more.
const MOST_ROUNDS: f32 = 1000.0;

/// The depth of a chart at a node.
#[derive(Clone, Copy, Debug)]
struct Depth {
    /// Four times the chart's number among those of all tiles; plus 1 for the collar of the node's own chart, which
    /// goes on in itself; plus 2 for the mirror image of the chart, which has the node where the chart has the node's
    /// image.
    key: u32,
    depth: f32,
}

impl Depth {
    fn is_image(&self) -> bool {
        self.key & 2 != 0
    }
}

/// The depths at the nodes of charts that others have, too, and of the features there.
pub struct Depths<'a> {
    tiles: Vec<Nodes<'a>>,
    /// Per tile, the number of its first chart.
    first_chart: Vec<u32>,
    nodes: Vec<Node>,
    /// The index of each node's first entry, followed by the number of entries. A node's own chart comes first.
    starts: Vec<u32>,
    entries: Vec<Depth>,
}

impl<'a> Depths<'a> {
    /// The depths at the nodes of the grids of some tiles; those of tiles without one are 1 on the chart itself.
    pub fn new(team: &Team, places: &Places, grids: &[Option<&'a Grid>]) -> Depths<'a> {
        let next = |sum: &mut u32, tile: &Arc<TileMesh>| Some(replace(sum, *sum + tile.charts.len() as u32));
        let first_chart: Vec<u32> = places.tiles.iter().scan(0, next).collect();
        let (mut kinds, mut beyond): (Vec<Vec<Plane<Kind>>>, Links) = (Vec::new(), Vec::new());
        for (t, grid) in grids.iter().enumerate() {
            let count = grid.map_or(0, |grid| grid.levels[0].blocks.list.len());
            let found = team.map(count, |b| kinds_of(places, t as u32, grid.as_ref(), b));
            let mut of_tile = Vec::with_capacity(count);
            for (of_block, links) in found {
                of_tile.push(of_block);
                beyond.extend(links);
            }
            kinds.push(of_tile);
        }
        let tiles = grids.iter().map(|grid| Nodes { grid: *grid, number: Vec::new() }).collect();
        let mut depths =
            Depths { tiles, first_chart, nodes: Vec::new(), starts: Vec::new(), entries: Vec::new() };
        for (_, place) in &beyond {
            if let Some((b, s)) = depths.nearest(places, place) {
                kinds[place.tile as usize][b][s].is_near = true;
            }
        }
        for (tile, kinds) in depths.tiles.iter_mut().zip(&mut kinds) {
            tile.number(kinds);
        }
        for (t, kinds) in kinds.iter().enumerate() {
            depths.add_tile(team, places, t as u32, kinds);
        }
        depths.starts.push(depths.entries.len() as u32);
        let number = |of: &Node| depths.tiles[of.tile as usize].number[of.block as usize][of.slot as usize];
        let link = |(node, place): &(Node, Place)| {
            let (b, s) = depths.nearest(places, place)?;
            Some([number(node), depths.tiles[place.tile as usize].number[b][s]])
        };
        let links: Vec<[u32; 2]> = beyond.iter().filter_map(link).collect();
        depths.settle(team, places, links);
        depths
    }

    /// Bytes at most while the depths of so many nodes are found that charts have in common, about.
    pub fn bytes_for(nodes: f64, blocks: usize) -> u64 {
        let of_node = size_of::<Node>() + 3 * size_of::<Depth>() + 40;
        (0.5 * nodes * of_node as f64) as u64
            + (blocks * (size_of::<Plane<Kind>>() + size_of::<Plane<u32>>())) as u64
    }

    /// Adds the nodes of a tile's charts with their depths by distance.
    fn add_tile(&mut self, team: &Team, places: &Places, index: u32, kinds: &[Plane<Kind>]) {
        let Some(grid) = self.tiles[index as usize].grid else { return };
        let (tile, level) = (&*places.tiles[index as usize], &grid.levels[0]);
        let found = team.map(kinds.len(), |b| {
            let (mut nodes, mut starts, mut entries) = (Vec::new(), Vec::new(), Vec::new());
            for s in (0..NODES).filter(|&s| kinds[b][s].is_near) {
                let triangle = grid.triangle[b][s];
                let place = Place { tile: index, triangle, uv: uv_of(grid, b, s), image: false };
                let own = 4 * (self.first_chart[index as usize] + tile.chart_of_triangle(triangle));
                starts.push(entries.len() as u32);
                entries.push(Depth { key: own, depth: 1.0 });
                for on in sheets(places, place).into_iter().filter(|on| on.is_collar) {
                    let depth = match on.image {
                        true => beside_mirror(places, &on, level.cells()),
                        false => depth_of(places, &on),
                    };
                    entries.push(Depth { key: self.key(&on, own), depth });
                }
                let rigid = kinds[b][s].rigid;
                nodes.push(Node { tile: index, block: b as u32, slot: s as u16, rigid });
            }
            (nodes, starts, entries)
        });
        for (b, (nodes, starts, entries)) in found.into_iter().enumerate() {
            for node in &nodes {
                self.tiles[index as usize].number[b][node.slot as usize] = self.nodes.len() as u32;
                self.nodes.push(*node);
            }
            let first = self.entries.len() as u32;
            self.starts.extend(starts.into_iter().map(|start: u32| first + start));
            self.entries.extend_from_slice(&entries);
        }
    }

    /// The block of a chart that holds the lower left node of the cell of a point in its plane, or `NONE`.
    pub(super) fn block(&self, tile: u32, chart: u32, uv: DVec2) -> u32 {
        self.tiles[tile as usize].grid.map_or(NONE, |grid| {
            let cell = (uv * grid.levels[0].cells()).floor();
            grid.levels[0].blocks.find(chart, cell.x as i64 >> 4, cell.y as i64 >> 4)
        })
    }

    /// The key of a chart at a place on the chart with the key `own`.
    fn key(&self, on: &OnChart, own: u32) -> u32 {
        let key = 4 * (self.first_chart[on.tile as usize] + on.chart);
        if on.image { key + 2 } else { key + u32::from(key == own && on.is_collar) }
    }

    /// The block and the slot of the node nearest to a place, if it is a node of the chart itself.
    fn nearest(&self, places: &Places, place: &Place) -> Option<(usize, usize)> {
        let tile = &self.tiles[place.tile as usize];
        let (grid, mesh) = (tile.grid?, &places.tiles[place.tile as usize]);
        let chart = mesh.chart_of_triangle(place.triangle);
        let last = grid.levels[0].cells();
        let at = (place.uv * last).round().clamp(DVec2::ZERO, last);
        let (b, s) = node_of(grid, chart, at.x as i64, at.y as i64)?;
        let triangle = grid.triangle[b][s];
        let is_own = (triangle as usize) < mesh.own() && mesh.chart_of_triangle(triangle) == chart;
        is_own.then_some((b, s))
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
    fn settle(&mut self, team: &Team, places: &Places, links: Vec<[u32; 2]>) {
        let count = self.nodes.len();
        // Links of both directions, sorted by node.
        let mut over: Vec<[u32; 2]> = links.iter().flat_map(|&[a, b]| [[a, b], [b, a]]).collect();
        over.sort_unstable();
        over.dedup();
        let mut edges: Vec<[u32; 2]> = Vec::with_capacity(2 * count);
        // Nodes with a neighbour that is far from all other charts, and the axis along which it lies.
        let mut beside_far: Vec<(u32, usize)> = Vec::new();
        for n in 0..count as u32 {
            for (axis, sign) in [(0, 1), (1, 1), (0, -1), (1, -1)] {
                match self.neighbour(n, axis, sign) {
                    NONE => (),
                    FAR => beside_far.push((n, axis)),
                    other if sign > 0 => edges.push([n, other]),
                    _ => (),
                }
            }
        }
        let within = edges.len();
        edges.extend(over.into_iter().filter(|[a, b]| a < b));
        self.settle_features(&edges, within);
        // Per chart, its reach; from node to node, a depth changes by this over the reach at most.
        let reaches: Vec<f64> =
            places.tiles.iter().flat_map(|tile| tile.charts.iter().map(|chart| chart.reach)).collect();
        let step = |key: u32, cells: f64| (SLOPE / (reaches[(key >> 2) as usize] * cells)) as f32;
        let of_tile = |n: u32| self.tiles[self.nodes[n as usize].tile as usize].grid;
        let cells_of = |n: u32| of_tile(n).map_or([1.0; 2], |grid| grid.levels[0].cells().to_array());
        for (n, axis) in beside_far.into_iter().filter(|(n, _)| !self.nodes[*n as usize].rigid) {
            let (own, cells) = (self.own(n), cells_of(n)[axis]);
            for e in self.starts[n as usize]..self.starts[n as usize + 1] {
                let Depth { key, depth } = self.entries[e as usize];
                if key != own && key & 2 == 0 {
                    self.entries[e as usize].depth = depth.min(step(key, cells));
                }
            }
        }
        let least = (0..count as u32).flat_map(|n| {
            let most = cells_of(n).into_iter().fold(1.0, f64::max);
            self.of(n).iter().map(move |entry| (entry.key, most))
        });
        let least = least.map(|(key, most)| step(key, most)).fold(1.0, f32::min);
        let rounds = (1.0 / least).ceil().min(MOST_ROUNDS) as usize + 1;
        for _ in 0..rounds {
            team.check_or_unwind();
            let mut changed = false;
            for k in 0..2 * edges.len() {
                // Forwards, then backwards.
                let e = if k < edges.len() { k } else { 2 * edges.len() - 1 - k };
                let [a, b] = edges[e];
                let cells = if e < within {
                    cells_of(a)[usize::from(along_v(&self.nodes, a, b))]
                } else {
                    [a, b].into_iter().flat_map(cells_of).fold(1.0, f64::max)
                };
                // Over a seam of a chart with itself, the chart and its collar change places.
                let (own, turns) = (self.own(a), e >= within && self.own(a) == self.own(b));
                for [from, to] in [[a, b], [b, a]] {
                    if self.nodes[to as usize].rigid {
                        continue;
                    }
                    for e in self.starts[to as usize]..self.starts[to as usize + 1] {
                        let entry = self.entries[e as usize];
                        if entry.is_image() {
                            continue;
                        }
                        let Depth { key, depth } = entry;
                        let swapped = if turns && key >> 1 == own >> 1 { key ^ 1 } else { key };
                        let bound = self.depth(from, swapped) + step(key, cells);
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

    /// The neighbour of a node on its chart.
    fn neighbour(&self, n: u32, axis: usize, sign: i64) -> u32 {
        let Node { tile, block, slot, .. } = self.nodes[n as usize];
        let tile = &self.tiles[tile as usize];
        let Some(grid) = tile.grid else { return NONE };
        beside(grid, block as usize, slot as usize, axis, sign).map_or(NONE, |(b, s)| tile.number[b][s])
    }

    /// Makes depths the same on each feature: connected rigid nodes. The first `within` edges lie on charts, the others
    /// connect charts.
    fn settle_features(&mut self, edges: &[[u32; 2]], within: usize) {
        let nodes = &self.nodes;
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
    }

    /// The parts that the charts that have a place take in the blend, in their order.
    pub(super) fn parts(&self, places: &Places, place: Place, sheets: &[OnChart]) -> Vec<f32> {
        let chart = places.tiles[place.tile as usize].chart_of_triangle(place.triangle);
        let own = 4 * (self.first_chart[place.tile as usize] + chart);
        let keys: Vec<u32> = sheets.iter().map(|on| self.key(on, own)).collect();
        let alone = |key: u32| f32::from(u8::from(key == own));
        let tile = &self.tiles[place.tile as usize];
        let mut weights: Vec<f32> = vec![0.0; keys.len()];
        let mut whole = 0.0;
        if let Some(grid) = tile.grid {
            let at = place.uv * grid.levels[0].cells();
            let cell = at.floor();
            let part = at - cell;
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let node = node_of(grid, chart, cell.x as i64 + dx, cell.y as i64 + dy);
                let number = node.map_or(NONE, |(b, s)| tile.number[b][s]);
                if number == NONE {
                    continue;
                }
                let [wx, wy] = [(dx, part.x), (dy, part.y)].map(|(d, p)| if d == 1 { p } else { 1.0 - p });
                let weight = (wx * wy) as f32;
                whole += weight;
                for (sum, &key) in weights.iter_mut().zip(&keys) {
                    let depth = if number == FAR { alone(key) } else { self.depth(number, key) };
                    *sum += weight * depth;
                }
            }
        }
        if whole > 0.0 {
            weights.iter_mut().for_each(|w| *w = smooth(*w / whole));
            self.hold(sheets, &mut weights);
            let sum: f32 = weights.iter().sum();
            if sum > 0.0 {
                weights.iter_mut().for_each(|w| *w /= sum);
                return weights;
            }
        }
        // Beside all nodes of its chart, too, the chart alone counts.
        keys.into_iter().map(alone).collect()
    }

    /// Gives charts that cannot move their whole weight, and the others what is left of 1: at their seams nothing
    /// moves.
    fn hold(&self, sheets: &[OnChart], weights: &mut [f32]) {
        let stays = |on: &OnChart| {
            let grid = self.tiles[on.tile as usize].grid;
            grid.is_some_and(|grid| grid.movable[on.chart as usize] == 0)
        };
        let of_still = sheets.iter().zip(&*weights).filter(|(on, _)| stays(on)).map(|(_, w)| *w);
        let held = of_still.fold(0.0, f32::max);
        if held <= 0.0 {
            return;
        }
        let sum = |still: bool| -> f32 {
            sheets.iter().zip(&*weights).filter(|(on, _)| stays(on) == still).map(|(_, w)| *w).sum()
        };
        let [moving, still] = [sum(false), sum(true)];
        for (on, weight) in sheets.iter().zip(weights) {
            *weight *= if stays(on) { held / still } else { (1.0 - held) / moving.max(f32::MIN_POSITIVE) };
        }
    }
}

/// From 0 to 1, level at both ends.
pub(super) fn smooth(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}
