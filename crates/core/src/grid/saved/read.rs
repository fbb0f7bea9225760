//! Reads a grid from untrusted bytes.

use std::sync::Arc;

use crate::allocation::{Collect, Grow, with_capacity};
use crate::error::{Error, Result};
use crate::grid::blocks::Part;
use crate::grid::build::levels_of;
use crate::grid::codes::Lengths;
use crate::grid::gather::Gather;
use crate::grid::interpolation::StiffnessPlanes;
use crate::grid::node_set::NodeSet;
use crate::grid::planes::{NODES, Plane, SIDE};
use crate::grid::pose::Pose;
use crate::grid::rigid_nodes::RigidNodes;
use crate::grid::survey::{levels, movable_of_charts};
use crate::grid::uv_triangle::uv_triangles;
use crate::grid::{Grid, Level, mirrors, survey_bytes};
use crate::mesh::{Mesh, NONE, TileMesh};
use crate::settings::MAX_GRID;
use crate::team::Team;

/// Bytes of a part.
const PART_BYTES: usize = 4 * 4 + 2 * SIDE;
/// Bytes of a square's rigid nodes.
const SQUARE_BYTES: usize = 2 * 4 + 3 * 2;

/// Reads numbers in sequence.
pub struct Reader<'a> {
    pub left: &'a [u8],
}

/// The error of bytes that cannot be a saved grid.
pub fn refuse(why: &str) -> Error {
    Error::argument(format!("data: {why}"))
}

impl<'a> Reader<'a> {
    pub fn bytes(&mut self, count: usize) -> Result<&'a [u8]> {
        let (bytes, left) = self.left.split_at_checked(count).ok_or_else(|| refuse("it is cut short"))?;
        self.left = left;
        Ok(bytes)
    }

    pub fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut array = [0; N];
        array.copy_from_slice(self.bytes(N)?);
        Ok(array)
    }

    pub fn u32(&mut self) -> Result<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn f32(&mut self) -> Result<f32> {
        self.array().map(f32::from_le_bytes)
    }

    /// Reads values of `size` bytes each, and checks each with `is_valid`.
    fn values<T: Copy>(
        &mut self,
        count: usize,
        size: usize,
        read: impl Fn(&[u8]) -> T,
        is_valid: impl Fn(T) -> bool,
        what: &str,
    ) -> Result<Vec<T>> {
        let bytes = count.checked_mul(size).ok_or_else(|| refuse("it is cut short"))?;
        let values: Vec<T> = self.bytes(bytes)?.chunks_exact(size).map(read).collected();
        match values.iter().all(|&x| is_valid(x)) {
            true => Ok(values),
            false => Err(refuse(&format!("it has {what} that cannot be"))),
        }
    }

    fn u32s(&mut self, count: usize, is_valid: impl Fn(u32) -> bool, what: &str) -> Result<Vec<u32>> {
        self.values(count, 4, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]), is_valid, what)
    }

    fn f32s(&mut self, count: usize, is_valid: impl Fn(f32) -> bool, what: &str) -> Result<Vec<f32>> {
        self.values(count, 4, |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]), is_valid, what)
    }

    /// Reads planes of values in sequence.
    fn planes<T: Copy + Default, const SIZE: usize>(
        &mut self,
        count: usize,
        read: impl Fn([u8; SIZE]) -> T,
        is_valid: impl Fn(usize, T) -> bool,
        what: &str,
    ) -> Result<Vec<Plane<T>>> {
        let bytes = count.checked_mul(NODES * SIZE).ok_or_else(|| refuse("it is cut short"))?;
        let bytes = self.bytes(bytes)?;
        let mut planes = with_capacity(count);
        for (n, of_plane) in bytes.chunks_exact(NODES * SIZE).enumerate() {
            let mut plane = [T::default(); NODES];
            for (value, bytes) in plane.iter_mut().zip(of_plane.chunks_exact(SIZE)) {
                let mut array = [0; SIZE];
                array.copy_from_slice(bytes);
                *value = read(array);
                if !is_valid(n, *value) {
                    return Err(refuse(&format!("it has {what} that cannot be")));
                }
            }
            planes.put(plane);
        }
        Ok(planes)
    }
}

/// Reads everything but the header, and checks it.
pub fn grid(
    team: &Team,
    from: &mut Reader,
    mesh: &Mesh,
    tile: &TileMesh,
    book: impl FnOnce(u64) -> Result<()>,
) -> Result<Grid> {
    let sizes = from.array::<24>()?;
    let size =
        |k: usize| u32::from_le_bytes([sizes[4 * k], sizes[4 * k + 1], sizes[4 * k + 2], sizes[4 * k + 3]]);
    let cells = [size(0), size(1)].map(|n| n as usize);
    let is_grid = |&n: &usize| n > 0 && n.is_multiple_of(SIDE) && n <= MAX_GRID as usize;
    if !cells.iter().all(is_grid) || size(2) as usize != tile.charts.len() {
        return Err(refuse("it has sizes that cannot be"));
    }
    let overlap = from.f32()?;
    let at_gaps = u64::from_le_bytes(from.array()?);
    let (parts, rigid) = read_parts(from, size(4) as usize, cells, tile.charts.len())?;
    let rigid_nodes = read_squares(from, size(5) as usize, cells)?;
    let movable = movable_of_charts(tile.charts.len(), &parts, &rigid);
    let survey = levels(team, cells, &movable, &parts);
    if survey.len() != size(3) as usize || !(0.0..=1.0).contains(&overlap) {
        return Err(refuse("it has sizes that cannot be"));
    }
    let triangles = tile.triangles.len();
    book(survey_bytes(&survey, triangles, tile.has_images()))?;
    let mut levels = levels_of(&survey, tile.charts.len());
    let count = levels.len();
    for (k, level) in levels.iter_mut().enumerate() {
        read_level(from, level, k, count)?;
    }
    let chart_of = tile.chart_of_triangles();
    for (k, level) in levels.iter_mut().enumerate() {
        level.held = Arc::new(mirrors::held(tile, &chart_of, &level.blocks, k, cells));
    }
    let list = &levels[0].blocks.list;
    let is_triangle = |t: u32| t == NONE || (t as usize) < triangles;
    let triangle = from.planes(list.len(), u32::from_le_bytes, |_, t| is_triangle(t), "triangles")?;
    for (b, (plane, block)) in triangle.iter().zip(list).enumerate() {
        let of_chart = |t: u32| t != NONE && chart_of[t as usize] == block.chart;
        let movable = &levels[0].movable[b];
        if plane.iter().zip(movable).any(|(&t, &movable)| movable != 0 && !of_chart(t)) {
            return Err(refuse("it has triangles that cannot be"));
        }
    }
    let gather = match levels.get(1) {
        Some(level) => read_gather(from, level.blocks.list.len(), triangles)?,
        None => Gather::default(),
    };
    if !from.left.is_empty() {
        return Err(refuse("it is too long"));
    }
    let has_extra = !levels[0].density.is_empty() || !levels[0].held.is_empty();
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
        rest: Arc::new(Pose::new(tile, |v| mesh.rest[v as usize], None)),
        survey: Arc::new(survey),
        parts: Arc::new(parts),
        rigid,
        rigid_nodes,
    })
}

/// Reads the parts: they must be sorted and nonempty, with all nodes inside the grid.
fn read_parts(
    from: &mut Reader,
    count: usize,
    cells: [usize; 2],
    charts: usize,
) -> Result<(Vec<Part>, Vec<bool>)> {
    if from.left.len() / PART_BYTES < count {
        return Err(refuse("it is cut short"));
    }
    let (mut parts, mut rigid) = (with_capacity::<Part>(count), with_capacity(count));
    for _ in 0..count {
        let [chart, x, y, is_rigid] = [from.u32()?, from.u32()?, from.u32()?, from.u32()?];
        let mut nodes = NodeSet::EMPTY;
        for row in &mut nodes.0 {
            *row = from.array().map(u16::from_le_bytes)?;
        }
        let part = Part { chart, x, y, nodes };
        let inside = |n: usize| {
            let place = |at: u32, k: usize| u64::from(at) * SIDE as u64 + k as u64;
            let (i, j) = (place(x, n % SIDE), place(y, n / SIDE));
            (1..cells[0] as u64).contains(&i) && (1..cells[1] as u64).contains(&j)
        };
        let is_good = (chart as usize) < charts
            && is_rigid <= 1
            && !nodes.is_empty()
            && parts.last().is_none_or(|last| last.key() < part.key())
            && (0..NODES).filter(|n| nodes.contains(n % SIDE, n / SIDE)).all(inside);
        if !is_good {
            return Err(refuse("it has nodes that cannot be"));
        }
        parts.put(part);
        rigid.put(is_rigid == 1);
    }
    Ok((parts, rigid))
}

/// Reads the rigid nodes of squares, which must be sorted and inside the grid.
fn read_squares(from: &mut Reader, count: usize, cells: [usize; 2]) -> Result<Vec<RigidNodes>> {
    if from.left.len() / SQUARE_BYTES < count {
        return Err(refuse("it is cut short"));
    }
    let mut squares = with_capacity::<RigidNodes>(count);
    for _ in 0..count {
        let square = [from.u32()?, from.u32()?];
        let counts = [from.array()?, from.array()?, from.array()?];
        let [rigid, frozen, overlapped] = counts.map(u16::from_le_bytes);
        let is_inside = square.iter().zip(cells).all(|(&at, cells)| at as usize <= cells / SIDE);
        let is_next = squares.last().is_none_or(|last| {
            let [x, y] = last.square;
            (y, x) < (square[1], square[0])
        });
        if !is_inside || !is_next || usize::from(rigid) > NODES || frozen.max(overlapped) > rigid {
            return Err(refuse("it has squares that cannot be"));
        }
        squares.put(RigidNodes { square, rigid, frozen, overlapped });
    }
    Ok(squares)
}

fn read_level(from: &mut Reader, level: &mut Level, k: usize, levels: usize) -> Result<()> {
    let blocks = level.blocks.list.len();
    let is_share = |x: f32| (0.0..=1.0).contains(&x);
    level.rigidity = from.planes(blocks, u16::from_le_bytes, |_, _| true, "rigidities")?;
    let codes = from.planes(4 * blocks, u16::from_le_bytes, |_, _| true, "lengths")?;
    let numbers = from.u32s(level.lengths.len() * 8, |_| true, "lengths")?;
    for (lengths, pairs) in level.lengths.iter_mut().zip(numbers.chunks_exact(8)) {
        *lengths = std::array::from_fn(|e| Lengths { base: pairs[2 * e], shift: pairs[2 * e + 1] });
    }
    if level.lengths.iter().flatten().any(|lengths| lengths.shift > 31) {
        return Err(refuse("it has lengths that cannot be"));
    }
    for (n, plane) in codes.iter().enumerate() {
        let lengths = level.lengths[level.blocks.list[n / 4].chart as usize][n % 4];
        let is_length = |&code: &u16| {
            let length = lengths.length(code);
            length.is_finite() && length.is_sign_positive()
        };
        if !plane.iter().all(is_length) {
            return Err(refuse("it has lengths that cannot be"));
        }
    }
    level.rest_length = Arc::new(codes.chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]).collected());
    level.floor = from.f32s(level.floor.len(), |x| x.is_finite() && x >= 0.0, "floors")?;
    if k + 1 < levels {
        level.interpolation = from.planes(blocks, u8::from_le_bytes, |_, w| w <= 254, "weights")?;
    }
    if k > 1 {
        let planes = from.planes(4 * blocks, f32::from_le_bytes, |_, x| x.is_finite(), "stiffnesses")?;
        level.stiffness =
            planes.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]] as StiffnessPlanes).collected();
    }
    if k > 0 {
        let coverage = from.planes(blocks, f32::from_le_bytes, |_, x| is_share(x), "coverages")?;
        level.coverage = Arc::new(coverage);
    }
    let density = from.u32()? as usize;
    if density != 0 && density != blocks {
        return Err(refuse("it has densities that cannot be"));
    }
    level.density = Arc::new(from.planes(density, f32::from_le_bytes, |_, x| is_share(x), "densities")?);
    Ok(())
}

fn read_gather(from: &mut Reader, blocks: usize, triangles: usize) -> Result<Gather> {
    let starts = from.u32s(blocks * NODES + 1, |_| true, "entries")?;
    if starts[0] != 0 || starts.windows(2).any(|pair| pair[0] > pair[1]) {
        return Err(refuse("it has entries that cannot be"));
    }
    let count = starts[starts.len() - 1] as usize;
    let read = |b: &[u8]| {
        let word = |k: usize| [b[k], b[k + 1], b[k + 2], b[k + 3]];
        (u32::from_le_bytes(word(0)), f32::from_le_bytes(word(4)))
    };
    let is_entry = |(t, fraction): (u32, f32)| (t as usize) < triangles && (0.0..=1.0).contains(&fraction);
    let entries = from.values(count, 8, read, is_entry, "entries")?;
    Ok(Gather::from_parts(starts, entries))
}
