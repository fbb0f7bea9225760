//! A tile whose charts continue beyond their borders: each chart with its collar, as far as that lies over nothing else
//! of the same chart. What is left out of a collar is beyond a border, as everything is without collars.
//!
//! Notation, here and in `sides`:
//!
//! - *chart*, *collar*: a chart of the tile, and the triangles around it that show the surface beyond its borders.
//! - *side*: a side of a chart's triangle. Its *twin* is the side of another chart at the same edge of the surface.
//! - *part*: one of the equal parts, as long as the collar's triangles there, into which each side is divided
//!   (`Collar::parts`). A *run* is a range of consecutive parts of a side.
//! - *contact*: a triangle of the collar that touches the chart, with the part of the side where it does.
//! - *kept*: a triangle of the collar that lies over no other kept triangle of its chart and collar, and is connected
//!   with the chart through kept triangles, from an open part.
//! - *open*: a part at whose contact the collar is kept: the chart continues there. All other parts are *shut*.
//! - *ending*: a chart that does not continue beyond its seams, and a tile of such charts.
//! - *stacked*: a chart that lies over another chart. It gets no collar, since what charts share must stay where it is.
//! - *reach*, *distance*, *depth*: how far a collar extends on the surface; a corner's distance from the chart there;
//!   1 at the chart, falling to 0 where the collar ends.

mod sides;

use std::ops::Range;

use glam::DVec2;

use crate::collar::{Across, Collar, CollarTriangle, Surface, Twin, collar};
use sides::{Contact, Open, Side, contacts, drop_runs, ends, is_open, open_sides, part_of, run_of};
use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::mesh::hash::{Table, enter};
use vrtm_core::mesh::overlaps::Overlaps;
use vrtm_core::mesh::{Chart, Cut, FacePoint, Mesh, Mirror, NONE, Source, TileMesh, Triangle};
use vrtm_core::settings::Beyond;
use vrtm_core::team::Team;

/// A tile with collars. Triangles of charts keep their numbers.
pub fn extended(team: &Team, mesh: &Mesh, tile: usize, beyond: &Beyond, ending_tiles: &[u32]) -> TileMesh {
    let source = &mesh.tiles[tile];
    let surface = Surface::new(mesh, tile, beyond);
    let stacked = stacked(source);
    // A seam with a stacked chart of the tile on its other side is shut, since that chart does not move there.
    let is_of_stacked =
        |of: &Source| of.tile as usize == tile && stacked[source.chart_of_triangle(of.triangle) as usize];
    let check = || team.check_or_unwind();
    // Of each collar only the kept part is stored before the next one is made.
    let extensions = team.map(source.charts.len(), |c| {
        let make = || Extension::new(source, c, collar(&surface, c, beyond.reach, &check), is_of_stacked);
        (!stacked[c]).then(make)
    });
    let mut extensions: Vec<Extension> = extensions.into_iter().map(Option::unwrap_or_default).collect();
    shut_one_sided(source, &surface, tile, ending_tiles, &mut extensions, &check);
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
    for (chart, extension) in source.charts.iter().zip(extensions) {
        check();
        let chart = add(&mut extended, chart, &extension);
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

/// The kept part of a collar, and the open parts of the chart's sides.
#[derive(Default)]
struct Extension {
    collar: Collar,
    /// The sides with open parts, ascending.
    open: Vec<Open>,
}

impl Extension {
    /// Keeps the triangles that lie over nothing else of the chart, nearer ones first, except those of `excluded`.
    fn new(tile: &TileMesh, chart: usize, collar: Collar, excluded: impl Fn(&Source) -> bool) -> Extension {
        if collar.triangles.is_empty() {
            return Extension::default();
        }
        let own = tile.charts[chart].triangles.clone();
        let first = own.len();
        let list = &collar.triangles;
        let uvs = tile.triangles[own].iter().map(|t| t.uv).chain(list.iter().map(|t| t.uv));
        let all = Overlaps::of(uvs.collect());
        let mut kept: Vec<bool> = zeroed(list.len());
        for (k, triangle) in list.iter().enumerate() {
            let counts = |other: usize| other < first || kept[other - first];
            let is_free = !all.any(triangle.uv, counts);
            kept[k] = is_free && in_tile(triangle.uv) && !excluded(&triangle.source);
        }
        let contacts = contacts(tile, &collar);
        Extension::connected(collar, &contacts, kept)
    }

    /// Keeps those of some triangles that are connected with the chart at these contacts.
    fn connected(collar: Collar, contacts: &[Contact], mut kept: Vec<bool>) -> Extension {
        loop {
            let open = open_sides(contacts, &kept);
            let reached = reached(&collar, &kept, contacts, &open);
            if reached == kept {
                return Extension { collar: part_of_collar(collar, &kept), open };
            }
            kept = reached;
        }
    }
}

/// Shuts the parts of seams at which only one of two charts continues, since the charts would come apart there. The
/// other chart has no open part there, or lies in a tile of `ending_tiles`; charts of all other tiles are taken to
/// continue. Short runs stay open: corners of charts have some, and features over them would lose more than is gained.
fn shut_one_sided(
    source: &TileMesh,
    surface: &Surface,
    tile: usize,
    ending_tiles: &[u32],
    extensions: &mut [Extension],
    check: &dyn Fn(),
) {
    let chart_of = source.chart_of_triangles();
    let beyond = |twin: &Twin| chart_of[twin.side.0 as usize] as usize;
    // True if the chart beyond a side continues anywhere.
    let continues = |extensions: &[Extension], side: Side| match surface.twin(side) {
        Some(twin) if twin.tile as usize == tile => !extensions[beyond(&twin)].open.is_empty(),
        Some(twin) => !ending_tiles.contains(&twin.tile),
        None => true,
    };
    // True if the chart beyond a part continues at that part.
    let continues_at = |extensions: &[Extension], contact: &Contact, parts: usize| {
        let Some(twin) = surface.twin(contact.side).filter(|twin| twin.tile as usize == tile) else {
            return true;
        };
        let Extension { collar, open } = &extensions[beyond(&twin)];
        let middle = (contact.part as f64 + 0.5) / parts as f64;
        let along = if twin.turns { 1.0 - middle } else { middle };
        is_open(open, twin.side, (along * collar.parts as f64) as usize)
    };
    // A part that is shut may shut others, so this is repeated until nothing changes.
    loop {
        check();
        // The contacts that a chart keeps, if it loses any.
        let kept_contacts = |c: usize| {
            let Extension { collar, open } = &extensions[c];
            let mut contacts = contacts(source, collar);
            contacts.retain(|contact| is_open(open, contact.side, contact.part));
            let before = contacts.len();
            contacts.retain(|contact| continues(extensions, contact.side));
            drop_runs(source, collar, &mut contacts, |contact| {
                continues_at(extensions, contact, collar.parts)
            });
            (contacts.len() < before).then_some((c, contacts))
        };
        let changed: Vec<(usize, Vec<Contact>)> = (0..extensions.len()).filter_map(kept_contacts).collect();
        if changed.is_empty() {
            return;
        }
        for (c, contacts) in changed {
            let collar = std::mem::take(&mut extensions[c]).collar;
            let kept = vec![true; collar.triangles.len()];
            extensions[c] = Extension::connected(collar, &contacts, kept);
        }
    }
}

/// The kept part of a collar.
fn part_of_collar(collar: Collar, kept: &[bool]) -> Collar {
    let mut numbers = vec![NONE; kept.len()];
    let mut count = 0;
    for (number, _) in numbers.iter_mut().zip(kept).filter(|(_, kept)| **kept) {
        *number = count;
        count += 1;
    }
    let across = |across: Across| match across {
        Across::Collar(other) if numbers[other as usize] == NONE => Across::Nothing,
        Across::Collar(other) => Across::Collar(numbers[other as usize]),
        _ => across,
    };
    // Allocated anew, without room for what is left out.
    let mut triangles = Vec::with_capacity(count as usize);
    for (triangle, _) in collar.triangles.into_iter().zip(kept).filter(|(_, kept)| **kept) {
        triangles.push(CollarTriangle { across: triangle.across.map(across), ..triangle });
    }
    Collar { triangles, ..collar }
}

fn in_tile(uv: [DVec2; 3]) -> bool {
    let [low, high] = [uv[0].min(uv[1]).min(uv[2]), uv[0].max(uv[1]).max(uv[2])];
    high.min_element() > 0.0 && low.max_element() < 1.0
}

/// The kept triangles that are connected with the chart through kept triangles, from open parts.
fn reached(collar: &Collar, kept: &[bool], contacts: &[Contact], open: &[Open]) -> Vec<bool> {
    let mut reached: Vec<bool> = zeroed(kept.len());
    let begins = |contact: &&Contact| is_open(open, contact.side, contact.part);
    let mut stack: Vec<u32> = contacts.iter().filter(begins).map(|contact| contact.triangle).collect();
    while let Some(k) = stack.pop() {
        if kept[k as usize] && !std::mem::replace(&mut reached[k as usize], true) {
            for across in collar.triangles[k as usize].across {
                if let Across::Collar(next) = across {
                    stack.push(next);
                }
            }
        }
    }
    reached
}

/// Identity of a point of a triangle: its vertices, weights and mirror.
type PointKey = ([u32; 3], [u64; 3], Option<Mirror>);

/// Adds the kept part of a collar to a tile; returns the extended chart.
fn add(tile: &mut TileMesh, chart: &Chart, extension: &Extension) -> Chart {
    let first = tile.triangles.len() as u32;
    let Extension { collar, open } = extension;
    let list = &collar.triangles;
    let mut vertices = chart.vertices.clone();
    let mut local_of_vertex: Table<u32, u32> = Table::default();
    for vertex in list.iter().flat_map(|triangle| &triangle.points).filter_map(FacePoint::vertex) {
        if !local_of_vertex.contains_key(&vertex) {
            enter(&mut local_of_vertex, vertex, vertices.len() as u32);
            vertices.push(vertex);
        }
    }
    // Points are numbered after all vertices.
    let mut points: Vec<FacePoint> = Vec::new();
    let mut local_of_point: Table<PointKey, u32> = Table::default();
    let mut local_of = |point: &FacePoint| {
        if let Some(vertex) = point.vertex() {
            return local_of_vertex[&vertex];
        }
        let key = (point.vertices, point.weights.map(f64::to_bits), point.mirror);
        if let Some(&local) = local_of_point.get(&key) {
            return local;
        }
        let local = (vertices.len() + points.len()) as u32;
        enter(&mut local_of_point, key, local);
        points.push(*point);
        local
    };
    let parts = collar.parts as f64;
    for Open { side, run } in open {
        let [from, to] = ends(tile, *side);
        let at = |part: usize| from + (part as f64 / parts) * (to - from);
        for [a, b] in [[0, run.start], [run.end, collar.parts]] {
            if a < b {
                tile.cuts.push(Cut { triangle: side.0, uv: [at(a), at(b)], is_gap: false });
            }
        }
    }
    // The neighbour at a corner, and the side of the chart from which walks continue to this triangle: of the triangles
    // at an open run, to the one in its middle.
    let across = |tile: &TileMesh, k: usize, corner: usize| match list[k].across[corner] {
        Across::Nothing => (NONE, None),
        Across::Collar(other) => (first + other, None),
        Across::Chart(side) => {
            let part = part_of(tile, collar, side, list[k].uv, corner);
            match run_of(open, side).filter(|run| run.contains(&part)) {
                None => (NONE, None),
                Some(run) => (side.0, (part == (run.start + run.end - 1) / 2).then_some(side)),
            }
        }
    };
    for (k, triangle) in list.iter().enumerate() {
        let number = tile.triangles.len() as u32;
        let neighbours = [0, 1, 2].map(|corner| {
            let (neighbour, entered) = across(tile, k, corner);
            if let Some((t, side)) = entered {
                tile.triangles[t as usize].neighbours[side as usize] = number;
            }
            neighbour
        });
        let local = triangle.points.each_ref().map(&mut local_of);
        tile.triangles.push(Triangle { local, uv: triangle.uv, neighbours });
        tile.sources.push(Source { distance: triangle.distance.map(|x| x as f32), ..triangle.source });
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
                let number = numbers.get(&key).copied().unwrap_or(depths.len() as u32);
                if number as usize == depths.len() {
                    enter(&mut numbers, key, number);
                    depths.push(f64::INFINITY);
                }
                let depth = &mut depths[number as usize];
                *depth = depth.min(left[k].max(0.0));
                number
            })
        })
        .collect();
    let mut set = |depth: f64, is_beyond: &dyn Fn(u32) -> bool| {
        for (of, t) in corners.iter().zip(collar.clone()) {
            for k in (0..3).filter(|&k| is_beyond(tile.triangles[t].neighbours[k])) {
                depths[of[(k + 1) % 3] as usize] = depth;
                depths[of[(k + 2) % 3] as usize] = depth;
            }
        }
    };
    // Ends first: a corner at which the collar both begins and ends counts as its beginning.
    set(0.0, &|neighbour| neighbour == NONE);
    set(1.0, &|neighbour| neighbour < own);
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
