//! A prepared tile as bytes, so that it need not be prepared again on every machine of a farm. What can be computed
//! quickly from the mesh and the movable nodes is computed again when a tile is loaded, and everything else is checked.
//! Damaged or forged bytes are refused or at worst give a bad warp; they never cause an access out of bounds.
//!
//! ```text
//! header     magic, format, length, key of the inputs, checksum of what follows
//! sizes      cells along u and v, charts, levels, parts, squares, density or not; overlap, nodes at gaps
//! parts      of all, chart, place, rigid or not; of all, nodes
//! squares    of all, layer and place; of all, covered, free and layered nodes
//! rigid      of how many squares; of all, place; of all, rigid, fixed and overlapped nodes
//! levels     per level: rigidity, rest lengths, their coding and floors, weights, stiffness, coverage, density
//! level 0    the triangle under each node
//! level 1    what metrics are gathered from
//! ```
//!
//! All numbers are little-endian.

mod numbers;
mod read;
mod write;

use xxhash_rust::xxh3::{Xxh3, xxh3_128};

use super::Grid;
use crate::error::Result;
use crate::grid::maps::{MapsOfTile, TileMaps, Values};
use crate::mesh::{Chart, Mesh, TileMesh};
use crate::settings::Seams;
use crate::team::Team;
use numbers::{Reader, Writer, refuse};
use write::write;

const MAGIC: [u8; 8] = *b"vrtmtile";
/// Increases with every change of the layout, or of what is computed from the same inputs.
const FORMAT: u32 = 5;
/// Bytes of the header.
const HEADER: usize = 8 + 4 + 4 + 8 + 16 + 16;
/// A hash that identifies the inputs of a grid: the tile's mesh, its maps, and the settings that a grid depends on.
pub fn key(mesh: &Mesh, tile: &TileMesh, MapsOfTile { own: maps, all }: MapsOfTile) -> u128 {
    let mut hash = Xxh3::new();
    let settings = &maps.settings;
    for number in maps.grid_size().map(|n| n as u64) {
        hash.update(&number.to_le_bytes());
    }
    let density = f32::from(u8::from(settings.orientation_density > 0.0));
    for number in [settings.smoothness, settings.smoothness_floor, density] {
        hash.update(&number.to_le_bytes());
    }
    hash.update(&[settings.overlap as u8, u8::from(settings.seams == Seams::Keep)]);
    for triangle in &tile.triangles {
        triangle.uv.iter().flat_map(|uv| uv.to_array()).for_each(|x| hash.update(&x.to_le_bytes()));
        triangle.neighbours.iter().chain(&triangle.local).for_each(|n| hash.update(&n.to_le_bytes()));
    }
    for uv in tile.cuts.iter().flat_map(|cut| cut.uv) {
        uv.to_array().iter().for_each(|x| hash.update(&x.to_le_bytes()));
    }
    for chart in &tile.charts {
        hash.update(&(chart.triangles.len() as u64).to_le_bytes());
        let positions = chart.of_mesh().flat_map(|v| mesh.rest[v as usize]);
        positions.for_each(|x| hash.update(&x.to_le_bytes()));
    }
    hash_maps(&mut hash, tile, maps);
    if !tile.sources.is_empty() {
        for source in &tile.sources {
            hash.update(&source.tile.to_le_bytes());
            source.uv.iter().flat_map(|uv| uv.to_array()).for_each(|x| hash.update(&x.to_le_bytes()));
        }
        for point in tile.charts.iter().flat_map(|chart| &chart.points) {
            point.weights.iter().for_each(|x| hash.update(&x.to_le_bytes()));
            hash.update(&[u8::from(point.mirror.is_some())]);
        }
        for (_, maps) in
            all.iter().enumerate().filter(|(k, _)| tile.sources.iter().any(|s| s.tile as usize == *k))
        {
            maps.grid_size().iter().for_each(|n| hash.update(&(*n as u64).to_le_bytes()));
            hash_maps(&mut hash, tile, maps);
        }
    }
    hash.digest128()
}

fn hash_maps(hash: &mut Xxh3, tile: &TileMesh, maps: &TileMaps) {
    for (values, per_vertex) in [(&maps.rigidity, &b""[..]), (&maps.mask, b"vertices")] {
        match values {
            Values::None => hash.update(&[0]),
            Values::Map(map) => map.add_to(hash),
            Values::Vertices(values) => {
                hash.update(per_vertex);
                let of_tile = tile.charts.iter().flat_map(Chart::of_mesh);
                of_tile.for_each(|v| hash.update(&values[v as usize].to_le_bytes()));
            }
        }
    }
}

/// Bytes of a saved grid.
pub fn size(grid: &Grid) -> usize {
    let mut count = Writer { out: None, at: 0 };
    write(grid, &mut count);
    HEADER + count.at
}

/// Saves a grid to exactly `size(grid)` bytes.
pub fn save(grid: &Grid, key: u128, out: &mut [u8]) {
    let length = out.len() as u64;
    let (header, payload) = out.split_at_mut(HEADER);
    write(grid, &mut Writer { out: Some(payload), at: 0 });
    let mut header = Writer { out: Some(header), at: 0 };
    header.one(MAGIC);
    header.one([FORMAT, 0]);
    header.one(length);
    header.one([key, xxh3_128(payload)]);
}

/// Loads a grid for a tile whose inputs have the given key. `book(bytes)` is called before the memory is allocated.
///
/// # Errors
/// `InvalidArgument` for bytes that are not a saved grid of this tile; the errors of `book`.
pub fn load(
    team: &Team,
    data: &[u8],
    key: u128,
    mesh: &Mesh,
    tile: &TileMesh,
    book: impl FnOnce(u64) -> Result<()>,
) -> Result<Grid> {
    let mut from = Reader(data);
    if from.one().ok() != Some(MAGIC) {
        return Err(refuse("it is no saved tile"));
    }
    // The reserved word may be used by a later version.
    let (format, reserved, length) = (from.one::<u32>()?, from.one::<u32>()?, from.one::<u64>()?);
    let [its_key, checksum] = from.one()?;
    if format != FORMAT {
        return Err(refuse(&format!("it has the format {format}, this version reads {FORMAT}")));
    }
    if reserved != 0 {
        return Err(refuse("its reserved word is not 0"));
    }
    if length != data.len() as u64 {
        return Err(refuse(&format!("it has {} bytes, but {length} were saved", data.len())));
    }
    if key != its_key {
        return Err(refuse("it was saved with another mesh, map or setting"));
    }
    if checksum != xxh3_128(from.0) {
        return Err(refuse("it is damaged"));
    }
    read::grid(team, &mut from, mesh, tile, book)
}
