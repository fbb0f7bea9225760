//! The table, JSON and plot of all cases.

use std::path::Path;

use plotters::prelude::*;
use serde_json::Value;

use super::case::Outcome;

// Okabe and Ito's colours, which are distinct for every kind of colour vision.
const COLOURS: [RGBColor; 4] =
    [RGBColor(0, 114, 178), RGBColor(230, 159, 0), RGBColor(0, 158, 115), RGBColor(213, 94, 0)];
const PANEL: (u32, u32) = (380, 330);
const TITLES: [&str; 3] = ["Seconds", "Peak of memory, MiB", "Memory held, MiB"];

const ABOUT: &str = "\
# Preparing a tile

`cargo bench -p vrtm-benches --bench prepare -- --solve` on the CPU. Sixteen charts cover a share of the tile, with discs of rigidity all over
its map (8 bits). Seconds of preparing it; bytes of the process beyond what the caller holds, at the peak and when the tile
is prepared, so that the mesh (16,384 quads) and the map count; then a first solve (`normal`), another one, the whole map
fetched in bands of 128 rows, the peak of all of that, and what stays.
";

/// Writes the files `out`.md, `out`.json and `out`.svg.
pub fn write(outcomes: &[Outcome], out: &Path) -> Result<(), String> {
    let rows: Vec<String> = outcomes.iter().map(Outcome::row).collect();
    let table = format!("{ABOUT}\n{}\n{}\n", Outcome::HEAD, rows.join("\n"));
    std::fs::write(out.with_extension("md"), table).map_err(|e| e.to_string())?;
    let json = Value::from(outcomes.iter().map(Outcome::to_json).collect::<Vec<_>>());
    std::fs::write(out.with_extension("json"), format!("{json:#}\n")).map_err(|e| e.to_string())?;
    draw(outcomes, &out.with_extension("svg")).map_err(|e| e.to_string())
}

/// Costs over the grid's size, a line per share.
fn draw(outcomes: &[Outcome], path: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let size = (3 * PANEL.0, PANEL.1);
    let area = SVGBackend::new(path, size).into_drawing_area();
    area.fill(&WHITE)?;
    let mut shares: Vec<f64> = outcomes.iter().map(Outcome::share).collect();
    shares.sort_by(f64::total_cmp);
    shares.dedup();
    // Sizes are powers of two, so the axis shows their exponents.
    let exponent = |outcome: &Outcome| (outcome.grid() as f64).log2();
    let mut grids: Vec<f64> = outcomes.iter().map(exponent).collect();
    grids.sort_by(f64::total_cmp);
    grids.dedup();
    let (Some(&first), Some(&last)) = (grids.first(), grids.last()) else { return Ok(()) };
    for (k, panel) in area.split_evenly((1, 3)).iter().enumerate() {
        let costs = || outcomes.iter().map(|outcome| outcome.costs()[k].max(1e-3));
        let (low, high) = (costs().fold(f64::INFINITY, f64::min), costs().fold(1e-3, f64::max));
        let mut chart = ChartBuilder::on(panel)
            .caption(TITLES[k], ("sans-serif", 16))
            .margin(10)
            .x_label_area_size(36)
            .y_label_area_size(52)
            .build_cartesian_2d(first..last.max(first + 1.0), (0.7 * low..1.4 * high).log_scale())?;
        chart
            .configure_mesh()
            .x_desc("cells on a side")
            .x_labels(grids.len())
            .x_label_formatter(&|x| format!("{:.0}", x.exp2()))
            .y_label_formatter(&|y| format!("{y}"))
            .light_line_style(TRANSPARENT)
            .draw()?;
        for (share, colour) in shares.iter().zip(COLOURS.iter().cycle()) {
            let of_share = outcomes.iter().filter(|outcome| outcome.share() == *share);
            let points: Vec<(f64, f64)> =
                of_share.map(|outcome| (exponent(outcome), outcome.costs()[k].max(1e-3))).collect();
            chart.draw_series(points.iter().map(|point| Circle::new(*point, 3, colour.filled())))?;
            chart
                .draw_series(LineSeries::new(points, colour.stroke_width(2)))?
                .label(format!("{:.0} % active", 100.0 * share))
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 16, y)], colour.stroke_width(2)));
        }
        if k == 0 {
            chart.configure_series_labels().position(SeriesLabelPosition::UpperLeft).draw()?;
        }
    }
    area.present()?;
    Ok(())
}
