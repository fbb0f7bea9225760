//! The figures of a frame: a printed line per tile has the most important ones.

use vrtm::{StrainReport, TileReport};

/// RMS strain of the rigid features of all tiles with the original UVs.
pub fn strain_before(tiles: &[TileReport]) -> f64 {
    let measured = tiles.iter().filter_map(|tile| tile.strain.as_ref());
    let [edges, squares] = measured.fold([0.0, 0.0], |[edges, squares], strain| {
        let (own, rms) = (strain.segments as f64, f64::from(strain.before.rms));
        [edges + own, squares + own * rms * rms]
    });
    (squares / f64::max(edges, 1.0)).sqrt()
}

/// Titles of the columns of [`line`].
pub const TITLES: &str = "tile      grid  strain RMS        95 %            helped  min J   nodes     ms";

/// A tile's figures in less than 80 characters.
pub fn line(r: &TileReport) -> String {
    let measured = |s: &StrainReport| {
        let (rms, p95) = ([s.before.rms, s.after.rms], [s.before.p95, s.after.p95]);
        let help = 100.0 * s.help;
        format!("{:.4} -> {:.4}  {:.3} -> {:.3}  {help:5.1} %", rms[0], rms[1], p95[0], p95[1])
    };
    let strain = r.strain.as_ref().filter(|s| s.segments > 0).map_or("nothing to measure".into(), measured);
    let grid = format!("{}x{}", r.grid[0], r.grid[1]);
    let (jacobian, nodes, ms) = (r.min_jacobian, r.nodes_active, r.times.total);
    format!("{}  {grid:>8}  {strain:<41}  {jacobian:.3} {nodes:7} {ms:6.0}", r.udim)
}
