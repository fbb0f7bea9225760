//! Rest lengths on all levels, in 16 bits (method §1, Codes): exact chords on level 0 (method §2), arc lengths on the
//! others (method §3). A block's lengths are computed again whenever they are needed: in f32 for all blocks, they would
//! be the largest array of all.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::blocks::Block;
use super::codes::Lengths;
use super::metric::{restrict_block, restrict_coverage};
use super::window::{self, WINDOW_NODES, place};
use super::{FLOOR_FRACTION, Grid, Level};
use crate::allocation::{Vec, boxed, vec, zeroed};
use crate::grid::planes::{EDGES, NODES, Plane, SIDE, slot};
use crate::mesh::triangle::barycentrics;
use crate::mesh::{Mesh, NONE, TileMesh};
use crate::team::{PerThread, Team};

/// Lengths of at most this fraction of the floor are stored as 0.
const SHORTEST: f32 = 1.0 / 1024.0;

/// Sets the rest lengths, their floors and the coverages of all levels.
pub(super) fn rest_lengths(team: &Team, grid: &mut Grid, mesh: &Mesh, tile: &TileMesh) {
    let chords = Chords::new(grid, mesh, tile);
    let medians = median_lengths(team, grid, &chords);
    for (k, level) in grid.levels.iter_mut().enumerate() {
        // An edge of level k is 2^k times as long.
        level.floor = medians.iter().map(|m| FLOOR_FRACTION * m * (1u32 << k) as f32).collect();
    }
    let (codes, lengths) = store(team, &grid.levels[0], |b, scratch| chords.block(grid, b, scratch));
    (grid.levels[0].rest_length, grid.levels[0].lengths) = (codes, lengths);
    let triangle = grid.pose_triangles(tile, &grid.rest);
    let triangles: Vec<[f32; 3]> = (0..grid.triangles.len()).map(|t| triangle(t).metric()).collect();
    drop(triangle);
    let mut metrics: Vec<[Plane; 3]> = Vec::new();
    for k in 1..grid.levels.len() {
        let (finer, level) = grid.levels.split_at_mut(k);
        let (finer, level) = (&finer[k - 1], &mut level[0]);
        let blocks = level.blocks.list.len();
        if k > 1 {
            let mut coverage = zeroed(blocks);
            team.fill(&mut coverage, |b, plane| *plane = restrict_coverage(level, finer, b));
            level.coverage = Arc::new(coverage);
        }
        let mut next = zeroed(blocks);
        team.fill(&mut next, |b, out| match k {
            1 => grid.gather.block(b, &triangles, out),
            _ => restrict_block(level, finer, &metrics, b, out),
        });
        metrics = next;
        let neighbours = &level.blocks.neighbours;
        (level.rest_length, level.lengths) = store(team, level, |b, scratch| {
            arc_lengths(&neighbours[b], &metrics, &mut scratch.lengths);
        });
    }
}

/// A level's rest lengths: the codes of each block, and the codings of each chart.
type Stored = (Arc<Vec<[Plane<u16>; 4]>>, Vec<[Lengths; 4]>);

/// Memory of a thread that computes a block's lengths, on the heap because the stack of a host's thread may be
/// small.
struct Scratch {
    /// The lengths of the edges that the block's nodes own.
    lengths: [Plane; 4],
    samples: Vec<Option<Sample>>,
}

impl Scratch {
    fn new() -> Box<Scratch> {
        boxed(Scratch { lengths: [[0.0; NODES]; 4], samples: vec![None; WINDOW_NODES] })
    }
}

/// Codes a level's rest lengths; `lengths(b, scratch)` computes those of block b.
fn store(team: &Team, level: &Level, lengths: impl Fn(usize, &mut Scratch) + Sync) -> Stored {
    let list = &level.blocks.list;
    let scratch = PerThread::new(team, Scratch::new);
    let least = |b: usize| level.floor[list[b].chart as usize] * SHORTEST;
    // Per block and direction, the shortest nonzero length and the longest length.
    let mut bounds = zeroed::<[[f32; 2]; 4]>(list.len());
    team.fill_on(&mut bounds, |worker, b, bounds| {
        scratch.with(worker, |scratch| {
            lengths(b, scratch);
            *bounds = scratch.lengths.each_ref().map(|plane| {
                let low = plane.iter().copied().filter(|&x| x > least(b)).fold(f32::INFINITY, f32::min);
                [low, plane.iter().copied().fold(0.0, f32::max)]
            });
        });
    });
    let of_chart = |range: &std::ops::Range<usize>, e: usize| {
        let of_blocks = || bounds[range.clone()].iter().map(|of_block| of_block[e]);
        let low = of_blocks().map(|[low, _]| low).fold(f32::INFINITY, f32::min);
        Lengths::between(low, of_blocks().map(|[_, high]| high).fold(0.0, f32::max))
    };
    let coding: Vec<[Lengths; 4]> =
        level.blocks.of_chart.iter().map(|range| std::array::from_fn(|e| of_chart(range, e))).collect();
    let mut codes = zeroed::<[[u16; NODES]; 4]>(list.len());
    team.fill_on(&mut codes, |worker, b, codes| {
        let coding = &coding[list[b].chart as usize];
        scratch.with(worker, |scratch| {
            lengths(b, scratch);
            for (e, lengths) in scratch.lengths.iter().enumerate() {
                for (code, length) in codes[e].iter_mut().zip(lengths) {
                    *code = coding[e].code(*length);
                }
            }
        });
    });
    (Arc::new(codes), coding)
}

/// Rest lengths of a block's edges on a coarser level.
fn arc_lengths(neighbours: &[u32; 9], metrics: &[[Plane; 3]], out: &mut [Plane; 4]) {
    let windows: [_; 3] = window::planes(neighbours, |b, c| &metrics[b][c]);
    let metric = |at: usize| [windows[0][at], windows[1][at], windows[2][at]];
    edges(out, |i, j, e| {
        let (di, dj) = EDGES[e];
        let other = place((i as i64 + 1 + di) as usize, (j as i64 + 1 + dj) as usize);
        length2(metric(place(i + 1, j + 1)), metric(other), [di as f32, dj as f32]).max(0.0).sqrt()
    });
}

/// Squared length of an offset under the mean of two metrics.
fn length2(a: [f32; 3], b: [f32; 3], d: [f32; 2]) -> f32 {
    let [e, f, g] = [0, 1, 2].map(|k| 0.5 * (a[k] + b[k]));
    d[0] * d[0] * e + 2.0 * d[0] * d[1] * f + d[1] * d[1] * g
}

/// Sets the values of all edges that the nodes (i, j) of a block own to `f(i, j, edge)`.
#[inline(always)]
fn edges(planes: &mut [Plane; 4], mut f: impl FnMut(usize, usize, usize) -> f32) {
    for j in 0..SIDE {
        for i in 0..SIDE {
            for (e, plane) in planes.iter_mut().enumerate() {
                plane[slot(i, j)] = f(i, j, e);
            }
        }
    }
}

/// Exact rest lengths of level 0 (method §2), in f64 from the mesh itself.
struct Chords<'a> {
    mesh: &'a Mesh,
    tile: &'a TileMesh,
    cells: DVec2,
    /// Scale factor of each chart.
    scales: Vec<f64>,
}

/// A node on its triangle: the position of the triangle's first vertex, and the node's position relative to it.
type Sample = (u32, DVec3, DVec3);

impl<'a> Chords<'a> {
    fn new(grid: &Grid, mesh: &'a Mesh, tile: &'a TileMesh) -> Chords<'a> {
        let cells = grid.levels[0].cells();
        Chords { mesh, tile, cells, scales: grid.rest.charts.iter().map(|c| c.scale).collect() }
    }

    /// The lengths of a block's edges. An edge inside one triangle is computed from that triangle's edge vectors.
    fn block(&self, grid: &Grid, b: usize, Scratch { lengths: out, samples }: &mut Scratch) {
        let level = &grid.levels[0];
        let Block { x, y, chart, .. } = level.blocks.list[b];
        let triangles = window::of(&level.blocks.neighbours[b], NONE, |b| &grid.triangle[b]);
        samples.fill(None);
        // Nodes that are neighbours are often on the same triangle.
        let mut present: Option<(u32, TriangleInSpace)> = None;
        for j in 0..SIDE + 2 {
            for i in 0..SIDE + 2 {
                let t = triangles[place(i, j)];
                if t == NONE || grid.chart_of[t as usize] != chart {
                    continue;
                }
                if present.as_ref().is_none_or(|(of, _)| *of != t) {
                    present = Some((t, TriangleInSpace::new(self, chart, t)));
                }
                if let Some((_, triangle)) = &present {
                    let node =
                        DVec2::new((x as usize * SIDE + i) as f64, (y as usize * SIDE + j) as f64) - 1.0;
                    samples[place(i, j)] = Some((t, triangle.first, triangle.at(node - triangle.origin)));
                }
            }
        }
        // The vector is scaled before it is squared: units of 1e300 must not overflow.
        let scale = self.scales[chart as usize];
        let length = |v: DVec3| (v * scale).length();
        // The last triangle that held both ends of an edge, with the lengths of its edges.
        let mut last: (u32, [f64; 4]) = (NONE, [0.0; 4]);
        edges(out, |i, j, e| {
            let (di, dj) = EDGES[e];
            let other = place((i as i64 + 1 + di) as usize, (j as i64 + 1 + dj) as usize);
            let chord = match (&samples[place(i + 1, j + 1)], &samples[other]) {
                (Some((s, ..)), Some((t, ..))) if s == t => {
                    if last.0 != *s {
                        let triangle = TriangleInSpace::new(self, chart, *s);
                        last.0 = *s;
                        for (length_of, (di, dj)) in last.1.iter_mut().zip(EDGES) {
                            *length_of = length(triangle.at(DVec2::new(di as f64, dj as f64)));
                        }
                    }
                    last.1[e]
                }
                (Some((_, p, v)), Some((_, q, w))) => length((*q - *p) + (*w - *v)),
                // One end has no triangle in the chart, so no movable node has this edge.
                _ => 0.0,
            };
            chord as f32
        });
    }
}

/// A triangle at rest: the map from the plane to space.
struct TriangleInSpace {
    /// The first UV corner, in cells.
    origin: DVec2,
    /// The other two UV corners, relative to the first.
    uv: [DVec2; 2],
    /// The first vertex.
    first: DVec3,
    /// The other two vertices, relative to the first.
    edges: [DVec3; 2],
}

impl TriangleInSpace {
    fn new(chords: &Chords, chart: u32, t: u32) -> TriangleInSpace {
        let source = &chords.tile.triangles[t as usize];
        let chart = &chords.tile.charts[chart as usize];
        let [a, b, c] = source.uv.map(|uv| uv * chords.cells);
        let [p, q, r] =
            source.local.map(|v| DVec3::from(chart.position(v, |v| chords.mesh.rest[v as usize])));
        TriangleInSpace { origin: a, uv: [b - a, c - a], first: p, edges: [q - p, r - p] }
    }

    /// The offset in space from the first vertex, for an offset in cells from the first UV corner.
    fn at(&self, d: DVec2) -> DVec3 {
        let [l1, l2] = barycentrics([DVec2::ZERO, self.uv[0], self.uv[1]], d);
        l1 * self.edges[0] + l2 * self.edges[1]
    }
}

/// Per chart, the smaller of two medians over its movable nodes: the median length of their edges to the east, and of
/// their edges to the north. On an anisotropic chart the larger median would exceed all lengths of the other direction.
fn median_lengths(team: &Team, grid: &Grid, chords: &Chords) -> Vec<f32> {
    let level = &grid.levels[0];
    let blocks = level.blocks.list.len();
    let counts: Vec<usize> =
        level.movable.iter().map(|plane| plane.iter().filter(|m| **m != 0).count()).collect();
    // The lengths of both directions, block by block. They take as many bytes as the codes, which are allocated later.
    let mut lengths: [Vec<f32>; 2] = [0, 1].map(|_| zeroed(counts.iter().sum()));
    let [east, north] = &mut lengths;
    let mut parts: Vec<(usize, &mut [f32], &mut [f32])> = Vec::with_capacity(blocks);
    let (mut east_left, mut north_left) = (&mut east[..], &mut north[..]);
    for (b, &count) in counts.iter().enumerate() {
        let (of_east, e) = std::mem::take(&mut east_left).split_at_mut(count);
        let (of_north, n) = std::mem::take(&mut north_left).split_at_mut(count);
        (east_left, north_left) = (e, n);
        if count > 0 {
            parts.push((b, of_east, of_north));
        }
    }
    let scratch = PerThread::new(team, Scratch::new);
    team.fill_on(&mut parts, |worker, _, (b, east, north)| {
        scratch.with(worker, |scratch| {
            chords.block(grid, *b, scratch);
            let movable = (0..NODES).filter(|&s| level.movable[*b][s] != 0);
            for (k, s) in movable.enumerate() {
                (east[k], north[k]) = (scratch.lengths[0][s], scratch.lengths[1][s]);
            }
        });
    });
    drop(parts);
    let charts = level.blocks.of_chart.len();
    let mut of_charts: Vec<(&mut [f32], f32)> = Vec::with_capacity(2 * charts);
    for direction in &mut lengths {
        let mut left = &mut direction[..];
        for range in &level.blocks.of_chart {
            let count = counts[range.clone()].iter().sum();
            let (of_chart, others) = std::mem::take(&mut left).split_at_mut(count);
            left = others;
            of_charts.push((of_chart, 0.0));
        }
    }
    team.fill(&mut of_charts, |_, (lengths, median)| {
        if !lengths.is_empty() {
            let middle = lengths.len() / 2;
            *median = *lengths.select_nth_unstable_by(middle, f32::total_cmp).1;
        }
    });
    (0..charts).map(|c| of_charts[c].1.min(of_charts[charts + c].1)).collect()
}
