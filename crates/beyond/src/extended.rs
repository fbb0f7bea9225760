//! A tile whose charts go on beyond their borders: each chart with its collar, as far as it lies over nothing else of
//! the same chart. What is left out of a collar is beyond a border, as everything is without collars.

mod sides;
#[cfg(test)]
mod tests;

use std::ops::Range;

use glam::DVec2;

use crate::collar::{Across, Collar, CollarTriangle, Surface, Twin, collar};
use sides::{AtSide, Open, Side, drop_runs, ends, open_sides, part_of, rims, run_of};
use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::mesh::hash::{Table, enter};
use vrtm_core::mesh::overlaps::Overlaps;
use vrtm_core::mesh::{Chart, Cut, FacePoint, Mesh, Mirror, NONE, Source, TileMesh, Triangle};
use vrtm_core::settings::Beyond;
use vrtm_core::team::Team;

/// A tile with collars. Triangles of charts keep their numbers. Charts that lie over others get no collars: what they
/// share must stay where it is. `stay` are the tiles whose charts do not go on beyond their seams.
pub fn extended(team: &Team, mesh: &Mesh, tile: usize, beyond: &Beyond, stay: &[u32]) -> TileMesh {
    let source = &mesh.tiles[tile];
    let surface = Surface::new(mesh, tile, beyond);
    let stacked = stacked(source);
    // Where a stacked chart of the tile lies beyond the seam, which stays, the seam is shut.
    let stays =
        |of: &Source| of.tile as usize == tile && stacked[source.chart_of_triangle(of.triangle) as usize];
    let check = || team.check_or_unwind();
    // Of each collar only what is used is kept, before the next one is made.
    let used = team.map(source.charts.len(), |c| {
        let is_open = !stacked[c];
        is_open.then(|| Used::new(source, c, collar(&surface, c, beyond.reach, &check), stays))
    });
    let mut used: Vec<Used> = used.into_iter().map(Option::unwrap_or_default).collect();
    shut_one_sided(source, &surface, tile, stay, &mut used, &check);
    let mut extended = TileMesh {
        udim: source.udim,
        uv_set: source.uv_set,
        layer: source.layer,
        triangles: source.triangles.iter().map(|triangle| Triangle { ..*triangle }).collect(),
        sources: Vec::new(),
        charts: Vec::with_capacity(source.charts.len()),
        cuts: source.cuts.clone(),
        chart_of: source.chart_of.clone(),
        welds: Vec::new(),
        edges_apart: source.edges_apart,
    };
    for (chart, used) in source.charts.iter().zip(used) {
        check();
        let chart = add(&mut extended, chart, &used);
        extended.charts.push(chart);
    }
    extended.cuts.sort_unstable_by_key(|cut| cut.triangle);
    extended
}

/// Per chart, whether it lies over another chart.
fn stacked(tile: &TileMesh) -> Vec<bool> {
    let charts = tile.chart_of_triangles();
    let mut stacked = zeroed(tile.charts.len());
    let all = Overlaps::of(tile.triangles.iter().map(|t| t.uv).collect());
    for (t, triangle) in tile.triangles.iter().enumerate() {
        let chart = charts[t] as usize;
        let is_other = |other: usize| charts[other] as usize != chart;
        stacked[chart] = stacked[chart] || all.any(triangle.uv, is_other);
    }
    stacked
}

/// The used part of a collar, and the sides through which it is reached.
#[derive(Default)]
struct Used {
    collar: Collar,
    /// The sides of the chart beyond which it goes on, ascending.
    open: Vec<Open>,
}

impl Used {
    /// Keeps the triangles that lie over nothing else of the chart, nearer ones first, as far as they hang together
    /// with it.
    fn new(tile: &TileMesh, chart: usize, collar: Collar, stays: impl Fn(&Source) -> bool) -> Used {
        let own = tile.charts[chart].triangles.clone();
        let list = &collar.triangles;
        if list.is_empty() {
            return Used::default();
        }
        let first = own.len();
        let all = tile.triangles[own].iter().map(|t| t.uv).chain(list.iter().map(|t| t.uv));
        let all = Overlaps::of(all.collect());
        let rims = rims(tile, &collar);
        let mut triangles: Vec<bool> = zeroed(list.len());
        for (k, triangle) in list.iter().enumerate() {
            let lies = |other: usize| other < first || triangles[other - first];
            triangles[k] = in_tile(triangle.uv) && !stays(&triangle.source) && !all.any(triangle.uv, lies);
        }
        Used::hanging(collar, &rims, triangles)
    }

    /// Keeps of some triangles those that hang together with the chart at these rims.
    fn hanging(collar: Collar, rims: &[AtSide], mut triangles: Vec<bool>) -> Used {
        loop {
            let open = open_sides(rims, &triangles);
            let reached = reached(&collar, &triangles, rims, &open);
            if reached == triangles {
                return Used { collar: part_of_collar(collar, &triangles), open };
            }
            triangles = reached;
        }
    }
}

/// Shuts the parts of seams at which only one of two charts could move, since they would come apart there. The other
/// chart does not go on, or lies in a tile of `stay`; charts of further tiles are taken to go on. Short runs of parts
/// stay open: corners of charts have some, and features over them would lose more than is gained.
fn shut_one_sided(
    source: &TileMesh,
    surface: &Surface,
    tile: usize,
    stay: &[u32],
    used: &mut [Used],
    check: &dyn Fn(),
) {
    let chart_of = source.chart_of_triangles();
    let of_triangle = |t: u32| chart_of[t as usize] as usize;
    let is_open = |used: &[Used], side: Side| match surface.twin(side) {
        Some(twin) if twin.tile as usize == tile => !used[of_triangle(twin.side.0)].open.is_empty(),
        Some(twin) => !stay.contains(&twin.tile),
        None => true,
    };
    let goes_on = |used: &[Used], rim: &AtSide, parts: usize| {
        let Some(Twin { side, turns, .. }) = surface.twin(rim.side).filter(|twin| twin.tile as usize == tile)
        else {
            return true;
        };
        let Used { collar, open } = &used[of_triangle(side.0)];
        let middle = (rim.part as f64 + 0.5) / parts as f64;
        let along = if turns { 1.0 - middle } else { middle };
        let part = (along * collar.parts as f64) as usize;
        run_of(open, side).is_some_and(|open| open.parts.contains(&part))
    };
    loop {
        check();
        // A part that is shut shuts others: until nothing changes.
        let less = |c: usize| {
            let Used { collar, open } = &used[c];
            let mut rims = rims(source, collar);
            rims.retain(|rim| run_of(open, rim.side).is_some_and(|open| open.parts.contains(&rim.part)));
            let count = rims.len();
            rims.retain(|rim| is_open(used, rim.side));
            drop_runs(source, collar, &mut rims, |rim| goes_on(used, rim, collar.parts));
            (rims.len() < count).then_some((c, rims))
        };
        let less: Vec<(usize, Vec<AtSide>)> = (0..used.len()).filter_map(less).collect();
        if less.is_empty() {
            return;
        }
        for (c, rims) in less {
            let collar = std::mem::take(&mut used[c]).collar;
            let all = vec![true; collar.triangles.len()];
            used[c] = Used::hanging(collar, &rims, all);
        }
    }
}

/// The part of a collar that is used.
fn part_of_collar(collar: Collar, used: &[bool]) -> Collar {
    let mut numbers = vec![NONE; used.len()];
    let mut count = 0;
    for (number, _) in numbers.iter_mut().zip(used).filter(|(_, used)| **used) {
        *number = count;
        count += 1;
    }
    let across = |across: Across| match across {
        Across::Collar(other) if numbers[other as usize] == NONE => Across::Nothing,
        Across::Collar(other) => Across::Collar(numbers[other as usize]),
        _ => across,
    };
    let list = collar.triangles.into_iter().zip(used).filter(|(_, used)| **used);
    let triangles =
        list.map(|(triangle, _)| CollarTriangle { across: triangle.across.map(across), ..triangle });
    // With no room for what is left out.
    let mut kept = Vec::with_capacity(count as usize);
    kept.extend(triangles);
    Collar { triangles: kept, ..collar }
}

fn in_tile(uv: [DVec2; 3]) -> bool {
    let [low, high] = [uv[0].min(uv[1]).min(uv[2]), uv[0].max(uv[1]).max(uv[2])];
    high.min_element() > 0.0 && low.max_element() < 1.0
}

/// The triangles that hang together with the chart.
fn reached(collar: &Collar, used: &[bool], rims: &[AtSide], open: &[Open]) -> Vec<bool> {
    let list = &collar.triangles;
    let mut reached: Vec<bool> = zeroed(list.len());
    let mut stack: Vec<u32> = Vec::new();
    let is_open = |rim: &&AtSide| run_of(open, rim.side).is_some_and(|open| open.parts.contains(&rim.part));
    for rim in rims.iter().filter(|rim| used[rim.triangle as usize]).filter(is_open) {
        if !std::mem::replace(&mut reached[rim.triangle as usize], true) {
            stack.push(rim.triangle);
        }
    }
    while let Some(k) = stack.pop() {
        for across in list[k as usize].across {
            if let Across::Collar(next) = across
                && used[next as usize]
                && !std::mem::replace(&mut reached[next as usize], true)
            {
                stack.push(next);
            }
        }
    }
    reached
}

/// Identity of a point of a triangle: its vertices, weights and mirror.
type PointKey = ([u32; 3], [u64; 3], Option<Mirror>);

/// Adds what is used of a collar to a tile; returns the extended chart.
fn add(tile: &mut TileMesh, chart: &Chart, used: &Used) -> Chart {
    let first = tile.triangles.len() as u32;
    let Used { collar, open } = used;
    let list = &collar.triangles;
    let mut vertices = chart.vertices.clone();
    let mut local_of: Table<u32, u32> = Table::default();
    let mut with_vertex = |vertices: &mut Vec<u32>, v: u32| match local_of.get(&v) {
        Some(&local) => local,
        None => {
            let local = vertices.len() as u32;
            vertices.push(v);
            enter(&mut local_of, v, local);
            local
        }
    };
    // Points are numbered after all vertices.
    let mut points: Vec<FacePoint> = Vec::new();
    let mut number_of: Table<PointKey, u32> = Table::default();
    let mut corner = |point: &FacePoint| {
        if let Some(v) = point.vertex() {
            return Ok(with_vertex(&mut vertices, v));
        }
        let key = (point.vertices, point.weights.map(f64::to_bits), point.mirror);
        let known = number_of.get(&key).copied();
        Err(known.unwrap_or_else(|| {
            let number = points.len() as u32;
            points.push(*point);
            enter(&mut number_of, key, number);
            number
        }))
    };
    let locals: Vec<[Result<u32, u32>; 3]> =
        list.iter().map(|triangle| triangle.points.each_ref().map(&mut corner)).collect();
    let parts = collar.parts as f64;
    for Open { side, parts: run } in open {
        let [from, to] = ends(tile, *side);
        let at = |part: usize| from + (part as f64 / parts) * (to - from);
        for [a, b] in [[0, run.start], [run.end, collar.parts]] {
            if a < b {
                tile.cuts.push(Cut { triangle: side.0, uv: [at(a), at(b)], is_gap: false });
            }
        }
    }
    let across = |tile: &TileMesh, k: usize, corner: usize| match list[k].across[corner] {
        Across::Nothing => (NONE, None),
        Across::Collar(other) => (first + other, None),
        Across::Chart(side) => {
            let part = part_of(tile, collar, side, list[k].uv, corner);
            match run_of(open, side).filter(|open| open.parts.contains(&part)) {
                None => (NONE, None),
                // From the chart, walks go on from the part in the middle.
                Some(Open { parts, .. }) => {
                    (side.0, Some(side).filter(|_| part == (parts.start + parts.end - 1) / 2))
                }
            }
        }
    };
    for (k, local) in locals.into_iter().enumerate() {
        let number = tile.triangles.len() as u32;
        let neighbours = [0, 1, 2].map(|corner| {
            let (neighbour, entered) = across(tile, k, corner);
            if let Some((t, side)) = entered {
                tile.triangles[t as usize].neighbours[side as usize] = number;
            }
            neighbour
        });
        let local = local.map(|local| local.unwrap_or_else(|point| vertices.len() as u32 + point));
        tile.triangles.push(Triangle { local, uv: list[k].uv, neighbours });
        tile.sources.push(Source { distance: list[k].distance.map(|x| x as f32), ..list[k].source });
    }
    let range = first as usize..tile.triangles.len();
    set_depths(tile, range.clone(), collar.reach);
    Chart { triangles: chart.triangles.clone(), collar: range, reach: collar.reach, vertices, points }
}

/// Sets the depths of a collar's corners: the distance to where the collar ends, in the plane, over the reach; and at
/// most what is left of the reach.
fn set_depths(tile: &mut TileMesh, collar: Range<usize>, reach: f64) {
    let own = tile.own() as u32;
    let mut numbers: Table<[u64; 2], u32> = Table::default();
    let mut depths: Vec<f64> = Vec::new();
    let corners: Vec<[u32; 3]> = collar
        .clone()
        .map(|t| {
            let left = tile.sources[t - own as usize].distance.map(|d| 1.0 - f64::from(d) / reach);
            [0, 1, 2].map(|k| {
                let key = tile.triangles[t].uv[k].to_array().map(f64::to_bits);
                match numbers.get(&key) {
                    Some(&number) => {
                        let depth = &mut depths[number as usize];
                        *depth = depth.min(left[k].max(0.0));
                        number
                    }
                    None => {
                        enter(&mut numbers, key, depths.len() as u32);
                        depths.push(left[k].max(0.0));
                        depths.len() as u32 - 1
                    }
                }
            })
        })
        .collect();
    // Ends first: a corner at which the collar both begins and ends counts as its beginning.
    for is_end in [true, false] {
        for (of, t) in corners.iter().zip(collar.clone()) {
            for k in 0..3 {
                let next = tile.triangles[t].neighbours[k];
                if if is_end { next == NONE } else { next < own } {
                    let depth = if is_end { 0.0 } else { 1.0 };
                    [1, 2].into_iter().for_each(|d| depths[of[(k + d) % 3] as usize] = depth);
                }
            }
        }
    }
    let mut is_known = false;
    while !is_known {
        is_known = true;
        for (of, t) in corners.iter().zip(collar.clone()) {
            let uv = tile.triangles[t].uv;
            for k in 0..3 {
                for other in [(k + 1) % 3, (k + 2) % 3] {
                    let along = depths[of[other] as usize] + uv[k].distance(uv[other]) / reach;
                    let depth = &mut depths[of[k] as usize];
                    // The beginning keeps its depth.
                    if *depth < 1.0 && along < *depth {
                        (*depth, is_known) = (along, false);
                    }
                }
            }
        }
    }
    for (of, t) in corners.iter().zip(collar) {
        tile.sources[t - own as usize].depth = of.map(|c| depths[c as usize] as f32);
    }
}
