//! A prepared tile as bytes, so that it need not be prepared again on every machine of a farm. What follows quickly from
//! the mesh and from the movable nodes is computed anew when a tile is loaded, and everything else is checked: bytes that
//! were damaged or made up are refused, or at worst give a bad warp; they lead to no access out of bounds.
//!
//! ```text
//! header     magic, format, length, key of the inputs, checksum of what follows
//! sizes      cells along u and v, charts, levels, parts, squares; overlap
//! parts      chart, place, rigid or not, nodes
//! squares    place, rigid and frozen nodes
//! levels     per level: rigidity, rest lengths, their coding and floors, weights, stiffness, coverage, density
//! level 0    the triangle under each node
//! level 1    what metrics are gathered from
//! ```
//!
//! All numbers are little-endian.

use std::sync::Arc;

use xxhash_rust::xxh3::{Xxh3, xxh3_128};

use super::blocks::{NODES, Part, Plane, SIDE};
use super::build::levels_of;
use super::codes::Lengths;
use super::gather::Gather;
use super::interpolation::StiffnessPlanes;
use super::node_set::NodeSet;
use super::pose::Pose;
use super::survey::{RigidNodes, levels, movable_of_charts, survey_bytes};
use super::{Grid, Level, Rigidity, TileMaps, uv_triangles};
use crate::error::{Error, Result};
use crate::mesh::{Mesh, NONE, TileMesh};
use crate::team::Team;

const MAGIC: [u8; 8] = *b"vrtmtile";
/// Grows with every change of the layout, and of what is computed from the same inputs.
const FORMAT: u32 = 1;
/// Bytes of the header.
const HEADER: usize = 8 + 4 + 4 + 8 + 16 + 16;
/// Bytes of a part.
const PART_BYTES: usize = 4 * 4 + 2 * SIDE;
/// Bytes of a square's rigid nodes.
const SQUARE_BYTES: usize = 2 * 4 + 2 * 2;

/// Tells the inputs of a grid apart: the tile's mesh, its maps, and the settings that a grid depends on.
pub(crate) fn key(mesh: &Mesh, tile: &TileMesh, maps: &TileMaps) -> u128 {
    let mut hash = Xxh3::new();
    let settings = &maps.settings;
    for number in maps.grid_size().map(|n| n as u64) {
        hash.update(&number.to_le_bytes());
    }
    let density = f32::from(u8::from(settings.orientation_density > 0.0));
    for number in [settings.smoothness, settings.smoothness_floor, density] {
        hash.update(&number.to_le_bytes());
    }
    hash.update(&[settings.overlap as u8]);
    for triangle in &tile.triangles {
        triangle.uv.iter().flat_map(|uv| uv.to_array()).for_each(|x| hash.update(&x.to_le_bytes()));
        triangle.neighbours.iter().chain(&triangle.local).for_each(|n| hash.update(&n.to_le_bytes()));
    }
    for chart in &tile.charts {
        hash.update(&(chart.triangles.len() as u64).to_le_bytes());
        let positions = chart.vertices.iter().flat_map(|&v| mesh.rest[v as usize]);
        positions.for_each(|x| hash.update(&x.to_le_bytes()));
    }
    match &maps.rigidity {
        Rigidity::None => hash.update(&[0]),
        Rigidity::Map(map) => map.hash(&mut hash),
        Rigidity::Vertices(values) => {
            let of_tile = tile.charts.iter().flat_map(|chart| &chart.vertices);
            of_tile.for_each(|&v| hash.update(&values[v as usize].to_le_bytes()));
        }
    }
    match &maps.mask {
        None => hash.update(&[0]),
        Some(mask) => mask.hash(&mut hash),
    }
    hash.digest128()
}

/// Bytes of a saved grid.
pub(crate) fn size(grid: &Grid) -> usize {
    let mut count = Writer { out: None, at: 0 };
    write(grid, &mut count);
    HEADER + count.at
}

/// Saves a grid to exactly `size(grid)` bytes.
pub(crate) fn save(grid: &Grid, key: u128, out: &mut [u8]) {
    let length = out.len() as u64;
    let (header, payload) = out.split_at_mut(HEADER);
    write(grid, &mut Writer { out: Some(payload), at: 0 });
    let checksum = xxh3_128(payload);
    let mut header = Writer { out: Some(header), at: 0 };
    header.bytes(&MAGIC);
    header.u32(FORMAT);
    header.u32(0);
    header.bytes(&length.to_le_bytes());
    header.bytes(&key.to_le_bytes());
    header.bytes(&checksum.to_le_bytes());
}

/// Writes numbers one after the other, or counts their bytes.
struct Writer<'a> {
    out: Option<&'a mut [u8]>,
    at: usize,
}

impl Writer<'_> {
    fn bytes(&mut self, bytes: &[u8]) {
        if let Some(out) = &mut self.out {
            out[self.at..self.at + bytes.len()].copy_from_slice(bytes);
        }
        self.at += bytes.len();
    }

    fn u32(&mut self, x: u32) {
        self.bytes(&x.to_le_bytes());
    }

    fn u16s<'n>(&mut self, numbers: impl IntoIterator<Item = &'n u16>) {
        numbers.into_iter().for_each(|x| self.bytes(&x.to_le_bytes()));
    }

    fn u32s<'n>(&mut self, numbers: impl IntoIterator<Item = &'n u32>) {
        numbers.into_iter().for_each(|x| self.bytes(&x.to_le_bytes()));
    }

    fn f32s<'n>(&mut self, numbers: impl IntoIterator<Item = &'n f32>) {
        numbers.into_iter().for_each(|x| self.bytes(&x.to_le_bytes()));
    }
}

fn write(grid: &Grid, to: &mut Writer) {
    let sizes = [
        grid.levels[0].nx,
        grid.levels[0].ny,
        grid.movable.len(),
        grid.levels.len(),
        grid.parts.len(),
        grid.rigid_nodes.len(),
    ];
    sizes.iter().for_each(|&n| to.u32(n as u32));
    to.f32s(&[grid.overlap]);
    for (part, rigid) in grid.parts.iter().zip(&grid.rigid) {
        to.u32s(&[part.chart, part.x, part.y, u32::from(*rigid)]);
        to.u16s(&part.nodes.0);
    }
    for RigidNodes { square, rigid, frozen } in &grid.rigid_nodes {
        to.u32s(square);
        to.u16s(&[*rigid, *frozen]);
    }
    for level in &grid.levels {
        to.u16s(level.rigidity.as_flattened());
        to.u16s(level.rest_length.as_flattened().as_flattened());
        level.lengths.iter().flatten().for_each(|l| to.u32s(&[l.base, l.shift]));
        to.f32s(&level.floor);
        to.bytes(level.interpolation.as_flattened());
        to.f32s(level.stiffness.as_flattened().as_flattened());
        to.f32s(level.coverage.as_flattened());
        to.u32(level.density.len() as u32);
        to.f32s(level.density.as_flattened());
    }
    to.u32s(grid.triangle.as_flattened());
    let (starts, entries) = grid.gather.parts();
    to.u32s(starts);
    for (t, fraction) in entries {
        to.u32(*t);
        to.f32s([fraction]);
    }
}

/// Reads numbers one after the other.
struct Reader<'a> {
    left: &'a [u8],
}

fn refuse(why: &str) -> Error {
    Error::argument(format!("data: {why}"))
}

impl<'a> Reader<'a> {
    fn bytes(&mut self, count: usize) -> Result<&'a [u8]> {
        let (bytes, left) = self.left.split_at_checked(count).ok_or_else(|| refuse("it is cut short"))?;
        self.left = left;
        Ok(bytes)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut array = [0; N];
        array.copy_from_slice(self.bytes(N)?);
        Ok(array)
    }

    fn u32(&mut self) -> Result<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn f32(&mut self) -> Result<f32> {
        self.array().map(f32::from_le_bytes)
    }

    /// Values of `size` bytes each, all of which have to satisfy `is_valid`.
    fn values<T: Copy>(
        &mut self,
        count: usize,
        size: usize,
        read: impl Fn(&[u8]) -> T,
        is_valid: impl Fn(T) -> bool,
        what: &str,
    ) -> Result<Vec<T>> {
        let bytes = count.checked_mul(size).ok_or_else(|| refuse("it is cut short"))?;
        let values: Vec<T> = self.bytes(bytes)?.chunks_exact(size).map(read).collect();
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

    /// Planes of values, one after the other.
    fn planes<T: Copy + Default, const SIZE: usize>(
        &mut self,
        count: usize,
        read: impl Fn([u8; SIZE]) -> T,
        is_valid: impl Fn(usize, T) -> bool,
        what: &str,
    ) -> Result<Vec<Plane<T>>> {
        let bytes = count.checked_mul(NODES * SIZE).ok_or_else(|| refuse("it is cut short"))?;
        let bytes = self.bytes(bytes)?;
        let mut planes = Vec::with_capacity(count);
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
            planes.push(plane);
        }
        Ok(planes)
    }
}

/// Loads a grid for a tile whose inputs have the given key. `book(bytes)` is asked before its memory is taken.
///
/// # Errors
/// `InvalidArgument` for bytes that are no saved grid of this tile; those of `book`.
pub(crate) fn load(
    team: &Team,
    data: &[u8],
    key: u128,
    mesh: &Mesh,
    tile: &TileMesh,
    book: impl FnOnce(u64) -> Result<()>,
) -> Result<Grid> {
    let mut from = Reader { left: data };
    if from.bytes(MAGIC.len()).ok() != Some(&MAGIC) {
        return Err(refuse("it is no saved tile"));
    }
    let format = from.u32()?;
    if format != FORMAT {
        return Err(refuse(&format!("it has the format {format}, this version reads {FORMAT}")));
    }
    from.u32()?;
    let length = from.array().map(u64::from_le_bytes)?;
    if length != data.len() as u64 {
        return Err(refuse(&format!("it has {} bytes, but {length} were saved", data.len())));
    }
    if from.array().map(u128::from_le_bytes)? != key {
        return Err(refuse("it was saved with another mesh, map or setting"));
    }
    let checksum = from.array().map(u128::from_le_bytes)?;
    if checksum != xxh3_128(from.left) {
        return Err(refuse("it is damaged"));
    }
    read(team, &mut from, mesh, tile, book)
}

fn read(
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
    let is_grid = |&n: &usize| n > 0 && n.is_multiple_of(SIDE) && n <= crate::settings::MAX_GRID as usize;
    if !cells.iter().all(is_grid) || size(2) as usize != tile.charts.len() {
        return Err(refuse("it has sizes that cannot be"));
    }
    let overlap = from.f32()?;
    let (parts, rigid) = read_parts(from, size(4) as usize, cells, tile.charts.len())?;
    let rigid_nodes = read_squares(from, size(5) as usize, cells)?;
    let movable = movable_of_charts(tile.charts.len(), &parts, &rigid);
    let survey = levels(team, cells, &movable, &parts);
    if survey.len() != size(3) as usize || !(0.0..=1.0).contains(&overlap) {
        return Err(refuse("it has sizes that cannot be"));
    }
    let triangles = tile.triangles.len();
    book(survey_bytes(&survey, triangles))?;
    let mut levels = levels_of(&survey, tile.charts.len());
    let count = levels.len();
    for (k, level) in levels.iter_mut().enumerate() {
        read_level(from, level, k, count)?;
    }
    let chart_of = tile.chart_of_triangles();
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
    Ok(Grid {
        levels,
        triangles: Arc::new(uv_triangles(tile, cells[0], cells[1])),
        chart_of: Arc::new(chart_of),
        triangle: Arc::new(triangle),
        gather: Arc::new(gather),
        movable,
        overlap,
        rest: Arc::new(Pose::new(tile, |v| mesh.rest[v as usize], None)),
        survey: Arc::new(survey),
        parts: Arc::new(parts),
        rigid,
        rigid_nodes,
    })
}

/// The parts, sorted, none of them empty, with nodes inside of the grid only.
fn read_parts(
    from: &mut Reader,
    count: usize,
    cells: [usize; 2],
    charts: usize,
) -> Result<(Vec<Part>, Vec<bool>)> {
    if from.left.len() / PART_BYTES < count {
        return Err(refuse("it is cut short"));
    }
    let (mut parts, mut rigid) = (Vec::<Part>::with_capacity(count), Vec::with_capacity(count));
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
        parts.push(part);
        rigid.push(is_rigid == 1);
    }
    Ok((parts, rigid))
}

/// The rigid nodes of squares, sorted, inside of the grid.
fn read_squares(from: &mut Reader, count: usize, cells: [usize; 2]) -> Result<Vec<RigidNodes>> {
    if from.left.len() / SQUARE_BYTES < count {
        return Err(refuse("it is cut short"));
    }
    let mut squares = Vec::<RigidNodes>::with_capacity(count);
    for _ in 0..count {
        let square = [from.u32()?, from.u32()?];
        let [rigid, frozen] = [from.array()?, from.array()?].map(u16::from_le_bytes);
        let is_inside = square.iter().zip(cells).all(|(&at, cells)| at as usize <= cells / SIDE);
        let is_next = squares.last().is_none_or(|last| {
            let [x, y] = last.square;
            (y, x) < (square[1], square[0])
        });
        if !is_inside || !is_next || usize::from(rigid) > NODES || frozen > rigid {
            return Err(refuse("it has squares that cannot be"));
        }
        squares.push(RigidNodes { square, rigid, frozen });
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
    level.rest_length = Arc::new(codes.chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]).collect());
    level.floor = from.f32s(level.floor.len(), |x| x.is_finite() && x >= 0.0, "floors")?;
    if k + 1 < levels {
        level.interpolation = from.planes(blocks, u8::from_le_bytes, |_, w| w <= 254, "weights")?;
    }
    if k > 1 {
        let planes = from.planes(4 * blocks, f32::from_le_bytes, |_, x| x.is_finite(), "stiffnesses")?;
        level.stiffness =
            planes.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]] as StiffnessPlanes).collect();
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
