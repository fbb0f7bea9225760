//! The sheet's lower left quarter: figures of each tile, bars of the strain, textures, and the legend of the strain's
//! colours. Bars and textures share the room that the others leave.

use vrtm::{StrainReport, TileReport};

use super::canvas::{Canvas, TEXT};
use super::material::{Colour, mix};
use super::stage::{INK, QUIET, SUPER, Stage, redirect};
use crate::field::Field;
use crate::report;

const STRETCH: Colour = [0.72, 0.015, 0.020];
const SQUEEZE: Colour = [0.020, 0.085, 0.72];
const SHEAR: Colour = [0.24, 0.015, 0.40];
/// Strain at which the colour is saturated.
const FULL: f32 = 0.30;
/// Colour of bars of strain with redirected UVs.
const REDIRECTED: Colour = [0.92, 0.60, 0.20];

/// Heights in pixels: of a line of text, of the legend, and of the empty space between two parts.
const LINE: usize = 20;
const LEGEND: usize = 42;
const SPACE: usize = 18;
/// Least height of a pair of bars, and the one from which further kinds of strain have bars of their own.
const PAIR: usize = 22;
const TALL: usize = 32;
/// Widths in pixels of the bars' names and values.
const NAME: usize = 136;
const VALUES: usize = 144;

/// Kinds of strain, the most important one first.
type Kind = (&'static str, fn(&vrtm::Strain) -> f32);
const KINDS: [Kind; 4] =
    [("RMS", |s| s.rms), ("95 % below", |s| s.p95), ("99 % below", |s| s.p99), ("largest", |s| s.max)];

/// Fills a part of the canvas.
pub fn draw(
    canvas: &mut Canvas,
    [left, top]: [usize; 2],
    [width, height]: [usize; 2],
    stage: &Stage,
    scale: f64,
    maps: &[Field<3>],
    reports: &[TileReport],
) {
    let bottom = top + height - LEGEND;
    legend(canvas, [left, bottom], width);
    let room = (bottom - top - SPACE) / LINE - 1;
    let mut lines: Vec<String> = reports.iter().map(report::line).collect();
    if lines.len() > room {
        lines.truncate(room - 1);
        lines.push(format!("... and {} more tiles", reports.len() - lines.len()));
    }
    lines.insert(0, report::TITLES.into());
    for (k, line) in lines.iter().enumerate() {
        canvas.text([left, top + LINE * k], TEXT, INK, line);
    }
    let top = top + LINE * lines.len() + SPACE;
    let mut bottom = bottom - SPACE;
    // Several tiles' textures would be too small to see anything.
    if let [map] = maps {
        let side = ((width - SPACE) / 2).min((bottom - top).saturating_sub(LINE));
        bottom -= side + LINE;
        let corners = [[left, bottom], [left + width - side, bottom]];
        textures(canvas, corners, side, map, |uv| stage.materials[0].colour(uv, scale));
        bottom = bottom.saturating_sub(SPACE);
    }
    bars(canvas, [left, top], [width, bottom.saturating_sub(top)], reports);
}

/// The texture of the only tile, as painted and as looked up, each with its name below.
fn textures(
    canvas: &mut Canvas,
    corners: [[usize; 2]; 2],
    side: usize,
    map: &Field<3>,
    painted: impl Fn([f32; 2]) -> Colour + Sync,
) {
    let samples = (side * SUPER) as f32;
    let uv = |x: usize, y: usize| [(x as f32 + 0.5) / samples, 1.0 - (y as f32 + 0.5) / samples];
    canvas.picture(corners[0], [side; 2], SUPER, |x, y| painted(uv(x, y)));
    canvas.picture(corners[1], [side; 2], SUPER, |x, y| painted(redirect(map, uv(x, y))));
    for ([x, y], label) in corners.into_iter().zip(["texture as painted", "texture as it is looked up"]) {
        canvas.text([x, y + side + 4], TEXT, INK, label);
    }
}

/// Bars of strain, a pair for each tile and kind, of as many kinds and tiles as there is room for.
fn bars(canvas: &mut Canvas, [left, top]: [usize; 2], [width, height]: [usize; 2], reports: &[TileReport]) {
    let measured = reports.iter().filter_map(|tile| Some((tile.udim, tile.strain.as_ref()?)));
    let mut tiles: Vec<(u32, &StrainReport)> = measured.filter(|(_, strain)| strain.segments > 0).collect();
    let height = height.saturating_sub(LINE);
    tiles.truncate(height / PAIR);
    if tiles.is_empty() {
        return;
    }
    let kinds = &KINDS[..(height / TALL / tiles.len()).clamp(1, KINDS.len())];
    let pairs: Vec<(String, [f32; 2])> = tiles
        .iter()
        .flat_map(|(udim, strain)| kinds.iter().map(move |kind| (udim, strain, kind)))
        .map(|(udim, strain, (name, of))| {
            let name = if reports.len() > 1 { format!("{udim} {name}") } else { (*name).into() };
            (name, [of(&strain.before), of(&strain.after)])
        })
        .collect();

    let (start, length) = (left + NAME, width - NAME - VALUES);
    canvas.text([left, top], TEXT, INK, "strain");
    for (x, colour, name) in [(start, QUIET, "original UVs"), (start + 160, REDIRECTED, "redirected UVs")] {
        canvas.picture([x, top + 2], [12, 12], 1, |_, _| colour);
        canvas.text([x + 20, top], TEXT, INK, name);
    }
    let most = pairs.iter().flat_map(|(_, values)| *values).fold(1e-9, f32::max);
    for (k, (name, values)) in pairs.iter().enumerate() {
        let [begin, end] = [k, k + 1].map(|k| top + LINE + 4 + (height - 4) * k / pairs.len());
        let bar = (end - begin - 6) / 2;
        let middle = begin + bar - 8;
        canvas.text([left, middle], TEXT, INK, name);
        let [before, after] = values;
        canvas.text([left + width - VALUES + 12, middle], TEXT, INK, &format!("{before:.4} -> {after:.4}"));
        for (y, value, colour) in [(begin, before, QUIET), (begin + bar, after, REDIRECTED)] {
            let size = ((value / most * length as f32).round() as usize).max(1);
            canvas.picture([start, y], [size, bar], 1, |_, _| colour);
        }
    }
}

/// Colour of a strain: white for none, red for stretch, blue for compression, violet for both (shear).
pub fn strain_colour([stretch, squeeze]: [f32; 2]) -> Colour {
    let (a, b) = ((stretch / FULL).min(1.0), (squeeze / FULL).min(1.0));
    mix(mix([0.92; 3], STRETCH, a), mix(SQUEEZE, SHEAR, a), b)
}

fn legend(canvas: &mut Canvas, [left, top]: [usize; 2], width: usize) {
    let both = 112;
    let long = width - both - SPACE;
    canvas.picture([left, top], [long, 18], 1, |x, _| {
        let strain = (2.0 * x as f32 / long as f32 - 1.0) * FULL;
        strain_colour([strain.max(0.0), (-strain).max(0.0)])
    });
    let right = width - both;
    canvas.picture([left + right, top], [both, 18], 1, |x, _| {
        strain_colour([x as f32 / both as f32 * FULL; 2])
    });
    for (x, text) in [
        (0, "-30 % squeezed"),
        (long / 2 - 4, "0"),
        (long - 120, "stretched +30 %"),
        (right, "both (sheared)"),
    ] {
        canvas.text([left + x, top + 22], TEXT, INK, text);
    }
}
