//! The plots: error over time, log-log, one panel per scene, as SVG.

use std::path::Path;

use plotters::prelude::*;

use crate::claims::strain;
use crate::efforts::NORMAL;
use crate::oracle::Done;
use crate::rows::Row;

// Okabe and Ito's colours, which are distinct for every kind of colour vision. Shapes are distinct, too.
const DESCENT: RGBColor = RGBColor(0, 114, 178);
const PBD: RGBColor = RGBColor(230, 159, 0);
const FOLDED: RGBColor = RGBColor(213, 94, 0);
const GREY: RGBColor = RGBColor(110, 110, 110);
const INK: RGBColor = RGBColor(40, 40, 40);

const PANEL: (u32, u32) = (330, 250);
const COLUMNS: usize = 4;
const HEAD: u32 = 92;
const HEAD_WIDTH: u32 = 1030;
/// Smaller gaps are drawn at this value: f32 does not resolve them.
const LEAST: f64 = 1e-6;

type Draw<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Outcome = Result<(), Box<dyn std::error::Error>>;

/// The error on an axis of the plots.
pub struct Plot {
    pub file: &'static str,
    title: &'static str,
    error: fn(&Row) -> f64,
    /// The label of the line at the error of the original UVs.
    before: &'static str,
    ticks: &'static [f64],
}

pub const GAP: Plot = Plot {
    file: "gap.svg",
    title: "Distance to the minimum of the energy (0.0001 % or less at the bottom), over time of a solve",
    error: |row| row.gap.max(LEAST),
    before: "original UVs = 100 %",
    ticks: &[1e-6, 1e-4, 1e-2, 1.0],
};

pub const STRAIN: Plot = Plot {
    file: "strain.svg",
    title: "Strain left inside rigid features (RMS, on the mesh), over time of a solve",
    error: strain,
    before: "original UVs",
    ticks: &[0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0],
};

/// A number with no more digits than its magnitude needs.
fn plain(x: f64) -> String {
    let digits = (-(x.abs().log10() + 1e-6).floor()).clamp(0.0, 6.0) as usize;
    format!("{x:.digits$}")
}

fn percent(fraction: &f64) -> String {
    format!("{} %", plain(100.0 * fraction))
}

fn time(ms: &f64) -> String {
    if *ms >= 999.0 { format!("{} s", plain(ms / 1000.0)) } else { format!("{} ms", plain(*ms)) }
}

impl Plot {
    /// Draws all cases into one picture.
    pub fn draw(&self, path: &Path, done: &[Done], note: &str) -> Result<(), String> {
        let rows = done.len().div_ceil(COLUMNS).max(1);
        let columns = done.len().clamp(1, COLUMNS);
        let size = ((columns as u32 * PANEL.0).max(HEAD_WIDTH), HEAD + rows as u32 * PANEL.1);
        // All panels share their axes, so that scenes can be compared.
        let ms = done.iter().flat_map(|done| &done.ran).filter_map(|ran| ran.row.ms);
        let times = span(ms.map(|times| times.median), 1.35);
        let errors = span(
            done.iter()
                .flat_map(Done::rows)
                .filter(|row| row.solver != "reference")
                .map(|row| (self.error)(&row)),
            1.6,
        );
        let draw = || -> Outcome {
            let root = SVGBackend::new(path, size).into_drawing_area();
            root.fill(&WHITE)?;
            let (head, body) = root.split_vertically(HEAD);
            self.head(&head, note)?;
            for (area, case) in body.split_evenly((rows, columns)).iter().zip(done) {
                self.panel(area, case, times, errors)?;
            }
            root.present()?;
            Ok(())
        };
        draw().map_err(|error| format!("{}: {error}", path.display()))
    }

    /// Draws the title, the legend, and a line about the measurement.
    fn head(&self, area: &Draw, note: &str) -> Outcome {
        let text = |size: u32| ("sans-serif", size).into_font().color(&INK);
        let bold = |size: u32| ("sans-serif", size).into_font().style(FontStyle::Bold).color(&INK);
        area.draw(&Text::new(self.title, (14, 12), bold(19)))?;
        area.draw(&Text::new(note.to_string(), (14, 38), ("sans-serif", 12).into_font().color(&GREY)))?;
        let y = 70;
        area.draw(&PathElement::new([(14, y), (44, y)], DESCENT.stroke_width(2)))?;
        area.draw(&Circle::new((29, y), 4, DESCENT.filled()))?;
        area.draw(&Text::new("descent (this library)", (52, y - 8), text(14)))?;
        area.draw(&PathElement::new([(212, y), (242, y)], PBD.stroke_width(2)))?;
        area.draw(&TriangleMarker::new((227, y), 5, PBD.filled()))?;
        area.draw(&Text::new("pbd (the paper)", (250, y - 8), text(14)))?;
        area.draw(&Cross::new((376, y), 5, FOLDED.stroke_width(3)))?;
        area.draw(&Text::new("folded result", (388, y - 8), text(14)))?;
        dashes(area, (494, 524), y)?;
        area.draw(&Text::new(self.before, (532, y - 8), text(14)))?;
        area.draw(&Circle::new((702, y), 8, INK.stroke_width(1)))?;
        area.draw(&Text::new("normal, the default", (718, y - 8), text(14)))?;
        area.draw(&Text::new("lower left is better", (868, y - 8), bold(14)))?;
        Ok(())
    }

    fn panel(&self, area: &Draw, done: &Done, (left, right): (f64, f64), (low, high): (f64, f64)) -> Outcome {
        let rows = done.rows();
        let timed: Vec<&Row> = rows.iter().filter(|row| row.ms.is_some()).collect();
        let ms = |row: &Row| row.ms.map_or(f64::NAN, |t| t.median);
        let before =
            rows.iter().find(|row| row.solver == "identity").map_or(f64::NAN, |row| (self.error)(row));
        let ticks = self.ticks.iter().copied().filter(|tick| (low..high).contains(tick));
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .margin_right(16)
            .caption(&done.case.name, ("sans-serif", 15).into_font().style(FontStyle::Bold).color(&INK))
            .x_label_area_size(24)
            .y_label_area_size(58)
            .build_cartesian_2d(
                (left..right).log_scale(),
                (low..high).log_scale().with_key_points(ticks.collect()),
            )?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(RGBColor(226, 226, 226))
            .axis_style(GREY)
            .label_style(("sans-serif", 12).into_font().color(&INK))
            .x_labels(5)
            .y_labels(5)
            .x_label_formatter(&time)
            .y_label_formatter(&percent)
            .draw()?;
        let level = [(left, before), (right, before)];
        chart.draw_series(DashedLineSeries::new(level, 5, 4, GREY.stroke_width(1)))?;
        let mut backends: Vec<&str> = timed.iter().map(|row| row.backend).collect();
        backends.sort_unstable();
        backends.dedup();
        for backend in backends {
            for (solver, colour) in [("pbd", PBD), ("descent", DESCENT)] {
                let of = |row: &&&Row| (row.solver, row.backend) == (solver, backend);
                let mut points: Vec<(f64, f64, &Row)> =
                    timed.iter().filter(of).map(|row| (ms(row), (self.error)(row), *row)).collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                // The line joins the rows whose error no faster row reaches.
                let mut least = f64::INFINITY;
                let line = points.iter().map(|&(x, y, _)| (x, y));
                let line = line.filter(|&(_, y)| {
                    let better = y < least;
                    least = least.min(y);
                    better
                });
                let line: Vec<(f64, f64)> = line.collect();
                chart.draw_series(LineSeries::new(line, colour.stroke_width(2)))?;
                for &(x, y, row) in &points {
                    let shape = match (row.folded(), solver) {
                        (true, _) => Cross::new((x, y), 4, FOLDED.stroke_width(3)).into_dyn(),
                        (false, "pbd") => TriangleMarker::new((x, y), 5, colour.filled()).into_dyn(),
                        _ => Circle::new((x, y), 4, colour.filled()).into_dyn(),
                    };
                    chart.draw_series([shape])?;
                    if row.effort == NORMAL {
                        chart.draw_series([Circle::new((x, y), 8, INK.stroke_width(1))])?;
                    }
                }
            }
        }
        Ok(())
    }
}

fn dashes(area: &Draw, (from, to): (i32, i32), y: i32) -> Outcome {
    for x in (from..to).step_by(9) {
        area.draw(&PathElement::new([(x, y), (x + 5, y)], GREY.stroke_width(2)))?;
    }
    Ok(())
}

/// The range of the positive values, widened by a factor.
fn span(values: impl Iterator<Item = f64>, by: f64) -> (f64, f64) {
    let positive = values.filter(|x| x.is_finite() && *x > 0.0);
    let (low, high) = positive.fold((f64::INFINITY, 0.0f64), |(low, high), x| (low.min(x), high.max(x)));
    if low > high { (0.1, 1.0) } else { (low / by, high * by) }
}
