//! The table in Markdown.

use std::fmt::Write as _;

use vrtm::MapReport;

use vrtm_render::difference::Difference;
use vrtm_render::gpu::Gpu;
use vrtm_testkit::bench;

pub struct Row {
    pub way: &'static str,
    pub reads: &'static str,
    /// Texels on a side of the map.
    pub map: Option<u32>,
    pub ms: f64,
    /// The map's additional time, in percent of the time of the original UVs in as many passes.
    pub more: Option<f64>,
    pub d: Difference,
}

/// The head of the table: the scene, and the machine on which it was drawn.
pub fn head(
    gpu: &Gpu,
    scene: &str,
    frame: usize,
    [width, height]: [u32; 2],
    texture: u32,
    count: usize,
) -> String {
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let machine = bench::processor().unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    let filter = match gpu.anisotropy() {
        1 => "trilinear".to_owned(),
        n => format!("anisotropic, {n} samples"),
    };
    let mut text = format!(
        "# Drawing through a redirection map\n\n\
         `cargo bench -p vrtm-benches --bench render`: {scene}, frame {frame}, {width} x {height} pixels, a texture of {texture} x {texture} \
         with mips ({filter}), on {} ({machine}, {cores} cores).\n\n",
        gpu.name
    );
    if gpu.software {
        text += "**A software driver: it draws on the processor, so times and shares show that the bench runs, not what a GPU \
                 takes.** Pictures are those of any driver, but for rounding and the filter.\n\n";
    }
    if cfg!(debug_assertions) {
        text += "Built with debug assertions, in wgpu as well.\n\n";
    }
    let filtered = if gpu.filterable { "filters" } else { "does not filter" };
    let clock = if gpu.software || gpu.tick.is_none() {
        "from the submission of a frame to its end"
    } else {
        "by the GPU's clock"
    };
    let _ = writeln!(
        text,
        "Milliseconds are medians over {count} frames of each row, taken in turn, {clock}. \"More\" is what the lookup adds to \
         the original UVs drawn in as many passes. The texture is read with explicit derivatives of the redirected UV, but in \
         `original` and `forward-implicit`, where the sampler finds them by itself; in two passes, the map is read three times \
         for them. \
         Differences are from a picture with the original UVs and a texture that was warped beforehand: the warp's nodes \
         inverted in f64 by the bench itself, in twice as many texels on a side; of 255, of each pixel of the mesh its worst \
         channel. What of them does not shrink with a larger map is the filter's: where it takes several texels for a pixel, \
         it takes the longer side of a footprint that lies elsewhere in a warped texture. The adapter's sampler {filtered} \
         32-bit floats.\n"
    );
    text
}

/// The rows of one view.
pub fn view(title: &str, rows: &[Row]) -> String {
    let mut text = format!("## {title}\n\n");
    text += "| way | reads | map | ms | more | mean | 99 % | max |\n|---|---|---|---|---|---|---|---|\n";
    for Row { way, reads, map, ms, more, d } in rows {
        let map = map.map_or("-".into(), |side| side.to_string());
        let more = more.map_or("-".into(), |more| format!("{more:+.0} %"));
        let _ = writeln!(
            text,
            "| {way} | {reads} | {map} | {ms:.2} | {more} | {:.2} | {} | {} |",
            d.mean, d.p99, d.max
        );
    }
    text + "\n"
}

/// Begins the table of the maps alone.
pub fn maps_head(texture: u32) -> String {
    format!(
        "## The maps alone\n\nDistance between the map, read bilinearly, and the redirection itself, in texels of the texture of \
         {texture}; and the quads of texels that fold.\n\n\
         | map | form | RMS | 99 % | max | folds |\n|---|---|---|---|---|---|\n"
    )
}

/// A row for a map of all tiles; errors are those of the worst tile.
pub fn map(side: u32, delta: bool, texture: u32, reports: &[MapReport]) -> String {
    let worst = |of: fn(&MapReport) -> f64| reports.iter().map(of).fold(0.0, f64::max) * f64::from(texture);
    let folds: u64 = reports.iter().map(|report| report.folds).sum();
    let form = if delta { "delta, rg16float" } else { "within the tile, rg32float" };
    format!(
        "| {side} | {form} | {:.4} | {:.3} | {:.2} | {folds} |\n",
        worst(|report| report.error_rms),
        worst(|report| report.error_p99),
        worst(|report| report.error_max)
    )
}

/// Begins the table of whole frames.
pub const FRAMES: &str = "\n## Frames\n\n\
    Solve (`normal`, as many cells as the map has texels; the benches of the GPU have its error), invert, and draw the whole \
    mesh (forward-delta): milliseconds that the program waits for, medians. The maps are deltas in f16, in memory that vrtm \
    and the renderer share, or fetched and uploaded again; the pictures are the same. \"map\" is inversion and readback, \
    \"draw\" has the upload of the map and of the mesh's corners.\n\n\
    | maps | texels | frame | solve | map | draw |\n|---|---|---|---|---|---|\n";

/// A row of it.
#[cfg(target_os = "linux")]
pub fn frame(name: &str, side: u32, t: &vrtm_render::live::Times) -> String {
    format!("| {name} | {side} | {:.2} | {:.2} | {:.2} | {:.2} |\n", t.frame(), t.solve, t.map, t.draw)
}
