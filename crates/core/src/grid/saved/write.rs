//! Writes a grid as bytes, or counts them.

use super::numbers::Writer;
use crate::grid::Grid;

/// Writes everything but the header.
pub fn write(grid: &Grid, to: &mut Writer) {
    let finest = &grid.levels[0];
    let counts = [grid.movable.len(), grid.levels.len(), grid.parts.len(), grid.squares.len()];
    [finest.nx, finest.ny].iter().chain(&counts).for_each(|&n| to.all([n as u32].into_iter()));
    to.one(u32::from(!finest.density.is_empty()));
    to.one(grid.overlap);
    to.one(grid.at_gaps);
    let parts = grid.parts.iter().zip(&grid.rigid);
    to.all(parts.map(|(part, &rigid)| [part.chart, part.x, part.y, u32::from(rigid)]));
    to.all(grid.parts.iter().map(|part| part.nodes.0));
    to.all(grid.squares.iter().map(|nodes| [nodes.square.layer, nodes.square.at[0], nodes.square.at[1]]));
    to.all(grid.squares.iter().map(|nodes| [nodes.covered, nodes.free, nodes.layered].map(|nodes| nodes.0)));
    to.one(grid.rigid_nodes.len() as u32);
    to.all(grid.rigid_nodes.iter().map(|nodes| nodes.square));
    to.all(grid.rigid_nodes.iter().map(|nodes| [nodes.rigid, nodes.fixed, nodes.overlapped]));
    for level in &grid.levels {
        to.all(level.rigidity.iter().copied());
        to.all(level.rest_length.iter().copied());
        to.all(level.lengths.iter().map(|chart| chart.map(|lengths| [lengths.base, lengths.shift])));
        to.all(level.floor.iter().copied());
        to.all(level.interpolation.iter().copied());
        to.all(level.stiffness.iter().copied());
        to.all(level.coverage.iter().copied());
        to.all(level.density.iter().copied());
    }
    to.all(grid.triangle.iter().copied());
    to.all(grid.gather.starts.iter().copied());
    to.all(grid.gather.entries.iter().map(|(t, fraction)| [*t, fraction.to_bits()]));
}
