//! Reads a grid from untrusted bytes: takes each array by the length that it must have, then checks its values.

use std::sync::Arc;

use super::numbers::{Reader, refuse};
use crate::allocation::Vec;
use crate::error::Result;
use crate::grid::blocks::Part;
use crate::grid::build::levels_of;
use crate::grid::codes::Lengths;
use crate::grid::gather::Gather;
use crate::grid::node_set::NodeSet;
use crate::grid::planes::{NODES, Plane, SIDE};
use crate::grid::pose::Pose;
use crate::grid::rigid_nodes::RigidNodes;
use crate::grid::square_nodes::SquareNodes;
use crate::grid::squares::Square;
use crate::grid::survey::{levels, movable_of_charts};
use crate::grid::uv_triangle::uv_triangles;
use crate::grid::{Grid, Level, labels, mirrors, survey_bytes};
use crate::mesh::{Mesh, NONE, TileMesh};
use crate::settings::MAX_GRID;
use crate::team::Team;

/// Refuses what cannot be.
fn check(can_be: bool, what: &str) -> Result<()> {
    if can_be { Ok(()) } else { Err(refuse(&format!("it has {what} that cannot be"))) }
}

/// Reads everything but the header, and checks it.
pub fn grid(
    team: &Team,
    from: &mut Reader,
    mesh: &Mesh,
    tile: &TileMesh,
    book: impl FnOnce(u64) -> Result<()>,
) -> Result<Grid> {
    let sizes = from.one::<[u32; 7]>()?.map(|n| n as usize);
    let [nx, ny, charts, level_count, part_count, square_count, density] = sizes;
    let cells = [nx, ny];
    let overlap: f32 = from.one()?;
    let at_gaps = from.one()?;
    let is_side = |n: &usize| *n > 0 && n.is_multiple_of(SIDE) && *n <= MAX_GRID as usize;
    check(
        cells.iter().all(is_side)
            && charts == tile.charts.len()
            && density <= 1
            && (0.0..=1.0).contains(&overlap),
        "sizes",
    )?;
    let (heads, nodes) = (from.all(part_count)?, from.all(part_count)?);
    let part = |(&[chart, x, y, _], &nodes): (&[u32; 4], &_)| Part { chart, x, y, nodes: NodeSet(nodes) };
    let parts: Vec<_> = heads.iter().zip(&nodes).map(part).collect();
    check(heads.iter().all(|head| head[3] <= 1) && are_parts(&parts, cells, charts), "nodes")?;
    let rigid: Vec<_> = heads.iter().map(|head| head[3] == 1).collect();
    let squares = squares(from, square_count, cells)?;
    let count = from.one::<u32>()? as usize;
    let (places, counts) = (from.all(count)?, from.all(count)?);
    let square = |(&square, &[rigid, fixed, overlapped]): (&[u32; 2], &[u16; 3])| RigidNodes {
        square,
        rigid,
        fixed,
        overlapped,
    };
    let rigid_nodes: Vec<_> = places.iter().zip(&counts).map(square).collect();
    check(are_squares(&rigid_nodes, cells), "squares")?;
    let movable = movable_of_charts(charts, &parts, &rigid);
    let survey = levels(team, cells, &movable, &parts);
    check(survey.len() == level_count, "sizes")?;
    let triangles = tile.triangles.len();
    book(survey_bytes(&survey, triangles, squares.len(), tile.has_images()))?;
    let mut levels = levels_of(&survey, charts);
    for (k, level) in levels.iter_mut().enumerate() {
        take_level(from, level, [k > 0, k > 1, k + 1 < level_count, density == 1])?;
        check_level(level)?;
    }
    let chart_of = tile.chart_of_triangles();
    for (k, level) in levels.iter_mut().enumerate() {
        level.hold = Arc::new(mirrors::hold(tile, &chart_of, &level.blocks, k, cells));
    }
    let triangle = from.all(levels[0].blocks.list.len())?;
    check(are_triangles(&triangle, &levels[0], &chart_of), "triangles")?;
    let gather = match levels.get(1) {
        Some(level) => gather(from, level.blocks.list.len(), triangles)?,
        None => Gather::default(),
    };
    if !from.0.is_empty() {
        return Err(refuse("it is too long"));
    }
    let features = Arc::new(labels::features(team, &levels, &survey[0].movable, &triangle));
    let has_extra = !levels[0].density.is_empty() || !levels[0].hold.is_empty();
    Ok(Grid {
        levels,
        triangles: Arc::new(uv_triangles(tile, cells[0], cells[1])),
        chart_of: Arc::new(chart_of),
        triangle: Arc::new(triangle),
        gather: Arc::new(gather),
        movable,
        overlap,
        at_gaps,
        has_extra,
        features,
        rest: Arc::new(Pose::new(tile, |v| mesh.rest[v as usize], None)),
        survey: Arc::new(survey),
        parts: Arc::new(parts),
        squares: Arc::new(squares),
        rigid,
        rigid_nodes,
    })
}

/// True if parts are sorted and nonempty, of one of the charts, with all nodes inside the grid.
fn are_parts(parts: &[Part], cells: [usize; 2], charts: usize) -> bool {
    let inside = |part: &Part, n: usize| {
        let place = |at: u32, k: usize| u64::from(at) * SIDE as u64 + k as u64;
        let (i, j) = (place(part.x, n % SIDE), place(part.y, n / SIDE));
        (1..cells[0] as u64).contains(&i) && (1..cells[1] as u64).contains(&j)
    };
    let is_good = |part: &Part| {
        let mut nodes = (0..NODES).filter(|n| part.nodes.contains(n % SIDE, n / SIDE));
        (part.chart as usize) < charts && !part.nodes.is_empty() && nodes.all(|n| inside(part, n))
    };
    parts.iter().all(is_good) && parts.is_sorted_by(|a, b| a.key() < b.key())
}

/// Takes squares, which must be sorted and inside the grid.
fn squares(from: &mut Reader, count: usize, cells: [usize; 2]) -> Result<Vec<SquareNodes>> {
    let (places, nodes) = (from.all::<[u32; 3]>(count)?, from.all::<[[u16; SIDE]; 3]>(count)?);
    let square = |(&[layer, x, y], nodes): (&[u32; 3], &[[u16; SIDE]; 3])| {
        let [covered, free, layered] = nodes.map(NodeSet);
        SquareNodes { square: Square { layer, at: [x, y] }, covered, free, layered }
    };
    let squares: Vec<SquareNodes> = places.iter().zip(&nodes).map(square).collect();
    let is_inside = |of: &SquareNodes| of.square.at.iter().zip(cells).all(|(&at, n)| at as usize <= n / SIDE);
    let are_sorted = squares.is_sorted_by(|a, b| a.square.key() < b.square.key());
    check(squares.iter().all(is_inside) && are_sorted, "squares")?;
    Ok(squares)
}

/// True if squares are sorted and inside the grid, with counts that can be.
fn are_squares(squares: &[RigidNodes], cells: [usize; 2]) -> bool {
    let is_good = |&RigidNodes { square, rigid, fixed, overlapped }: &RigidNodes| {
        square.iter().zip(cells).all(|(&at, cells)| at as usize <= cells / SIDE)
            && usize::from(rigid) <= NODES
            && fixed.max(overlapped) <= rigid
    };
    let key = |nodes: &RigidNodes| (nodes.square[1], nodes.square[0]);
    squares.iter().all(is_good) && squares.is_sorted_by(|a, b| key(a) < key(b))
}

/// Takes a level's arrays; `has` says which of them it has: coverage, stiffness, interpolation, density.
fn take_level(from: &mut Reader, level: &mut Level, has: [bool; 4]) -> Result<()> {
    let blocks = level.blocks.list.len();
    let [coverage, stiffness, interpolation, density] = has.map(|has| if has { blocks } else { 0 });
    level.rigidity = from.all(blocks)?;
    level.rest_length = Arc::new(from.all(blocks)?);
    let lengths = from.all::<[[u32; 2]; 4]>(level.lengths.len())?;
    let of_chart = |chart: &[[u32; 2]; 4]| chart.map(|[base, shift]| Lengths { base, shift });
    level.lengths = lengths.iter().map(of_chart).collect();
    level.floor = from.all(level.floor.len())?;
    level.interpolation = from.all(interpolation)?;
    level.stiffness = from.all(stiffness)?;
    level.coverage = Arc::new(from.all(coverage)?);
    level.density = Arc::new(from.all(density)?);
    Ok(())
}

fn check_level(level: &Level) -> Result<()> {
    let are_shares = |planes: &[Plane<f32>]| planes.as_flattened().iter().all(|x| (0.0..=1.0).contains(x));
    check(level.lengths.iter().flatten().all(|lengths| lengths.shift <= 31), "lengths")?;
    let are_lengths = |(codes, lengths): (&Plane<u16>, &Lengths)| {
        codes.iter().map(|&code| lengths.length(code)).all(|x| x.is_finite() && x.is_sign_positive())
    };
    let mut blocks = level.rest_length.iter().zip(&level.blocks.list);
    let of_block = |chart: u32| &level.lengths[chart as usize];
    check(blocks.all(|(codes, block)| codes.iter().zip(of_block(block.chart)).all(are_lengths)), "lengths")?;
    check(level.floor.iter().all(|x| x.is_finite() && *x >= 0.0), "floors")?;
    check(level.interpolation.as_flattened().iter().all(|w| *w <= 254), "weights")?;
    let mut stiffness = level.stiffness.as_flattened().as_flattened().iter();
    check(stiffness.all(|x| x.is_finite()), "stiffnesses")?;
    check(are_shares(&level.coverage), "coverages")?;
    check(are_shares(&level.density), "densities")
}

/// True if there are such triangles, and movable nodes have one of their chart.
fn are_triangles(planes: &[Plane<u32>], level: &Level, chart_of: &[u32]) -> bool {
    let mut blocks = planes.iter().zip(&*level.movable).zip(&level.blocks.list);
    blocks.all(|((plane, movable), block)| {
        plane.iter().zip(movable).all(|(&t, &movable)| match chart_of.get(t as usize) {
            Some(&chart) => movable == 0 || chart == block.chart,
            None => movable == 0 && t == NONE,
        })
    })
}

fn gather(from: &mut Reader, blocks: usize, triangles: usize) -> Result<Gather> {
    let starts: Vec<u32> = from.all(blocks * NODES + 1)?;
    check(starts[0] == 0 && starts.is_sorted(), "entries")?;
    let entries = from.all::<[u32; 2]>(starts[starts.len() - 1] as usize)?;
    let entries: Vec<(u32, f32)> =
        entries.iter().map(|&[t, fraction]| (t, f32::from_bits(fraction))).collect();
    let is_entry = |(t, fraction): &(u32, f32)| (*t as usize) < triangles && (0.0..=1.0).contains(fraction);
    check(entries.iter().all(is_entry), "entries")?;
    Ok(Gather { starts, entries })
}
