//! The table in Markdown.

use std::fmt::Write as _;

use crate::render::difference::Difference;
use crate::render::gpu::Gpu;

pub struct Row {
    pub way: &'static str,
    pub reads: &'static str,
    /// Texels on a side of the map.
    pub map: Option<u32>,
    pub ms: f64,
    /// Percent of the time of the original UVs in as many passes that the map adds.
    pub more: Option<f64>,
    pub d: Difference,
}

/// What was drawn, and on what.
pub fn head(
    gpu: &Gpu,
    scene: &str,
    frame: usize,
    [width, height]: [u32; 2],
    texture: usize,
    count: usize,
) -> String {
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let machine = processor().unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    let mut text = format!(
        "# Drawing through a redirection map\n\n\
         `cargo bench --bench render`: {scene}, frame {frame}, {width} x {height} pixels, a texture of {texture} x {texture} \
         with mips and anisotropic filtering over {} samples, on {} ({machine}, {cores} cores).\n\n",
        gpu.anisotropy(),
        gpu.name
    );
    if gpu.software {
        text += "**A software driver: it draws on the processor, so times and shares say that the bench runs, not what a GPU \
                 takes.** Pictures are those of any driver, but for rounding.\n\n";
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
         inverted in f64 by the bench itself, four samples for each texel; of 255, of each pixel of the mesh its worst \
         channel. The adapter's sampler {filtered} 32-bit floats. `forward-mips` reads the map as any other texture, which is a \
         mistake: it stands here for its error.\n"
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

/// The processor's name, where the system tells.
fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(": ")?.1.to_owned())
}
