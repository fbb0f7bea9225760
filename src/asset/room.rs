//! Grids that are too large for a GPU: each level has to fit into one of its buffers.

use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::grid::planes::SIDE;
use vrtm_core::grid::survey::Survey;
use vrtm_core::grid::{Grid, Level};
use vrtm_core::mesh::TileMesh;

use super::given::Call;

/// Returns the error of a surveyed grid that is too large.
pub(super) fn of_survey(call: &Call, tile: usize, survey: &Survey) -> Result<()> {
    let size = survey.levels[0].size;
    check(call, tile, survey.coverer.tile, size, most_blocks(survey))
}

/// Returns the error of a grid that is too large.
pub(super) fn of_grid(call: &Call, tile: usize, mesh: &TileMesh, grid: &Grid) -> Result<()> {
    let blocks = |level: &Level| level.blocks.list.len();
    let size = [grid.levels[0].nx, grid.levels[0].ny];
    check(call, tile, mesh, size, grid.levels.iter().map(blocks).max().unwrap_or_default())
}

/// Blocks of the level that has most.
fn most_blocks(survey: &Survey) -> usize {
    survey.levels.iter().map(|level| level.blocks.list.len()).max().unwrap_or_default()
}

fn check(call: &Call, tile: usize, mesh: &TileMesh, size: [usize; 2], blocks: usize) -> Result<()> {
    let Some(gpu) = call.device.gpu() else { return Ok(()) };
    let most = gpu.most_blocks();
    if blocks <= most {
        return Ok(());
    }
    let fitting = match largest(call, tile, mesh, size, blocks, most) {
        Some([width, height]) => format!("at most {width} x {height} cells fit"),
        None => "no grid fits".to_owned(),
    };
    let message = format!(
        "grid: {} x {} cells of {} take {blocks} blocks of {SIDE} x {SIDE} nodes, but a buffer of the GPU {} holds \
         {most}: {fitting}; on the CPU all do",
        size[0],
        size[1],
        mesh.name(),
        gpu.info().name
    );
    Err(Error::new(ErrorKind::Unsupported, message))
}

/// The largest grid of the same shape with at most `most` blocks on each level, where one of `size` has `blocks`.
fn largest(
    call: &Call,
    tile: usize,
    mesh: &TileMesh,
    size: [usize; 2],
    blocks: usize,
    most: usize,
) -> Option<[usize; 2]> {
    let longer = size[0].max(size[1]);
    let scaled = |side: usize| size.map(|n| (n * side).div_ceil(longer).next_multiple_of(SIDE));
    let blocks_at =
        |side: usize| most_blocks(&Survey::new(call.team, mesh, call.given.of(tile), scaled(side)));
    // Blocks grow as the area, and along borders as the side: a step down by the area alone stays above the result.
    let (mut side, mut blocks) = (longer, blocks);
    while blocks > most {
        let by_area = side as f64 * (most as f64 / blocks as f64).sqrt();
        side = (by_area as usize / SIDE * SIDE).min(side - SIDE);
        if side == 0 {
            return None;
        }
        blocks = blocks_at(side);
    }
    while blocks_at(side + SIDE) <= most {
        side += SIDE;
    }
    Some(scaled(side))
}
