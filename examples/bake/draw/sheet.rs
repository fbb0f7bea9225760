//! Draws the sheet of a frame: rest, deformed and corrected side by side, the strain as colours below, and the figures.

use vrtm::TileReport;
use vrtm_examples::islands::islands;
use vrtm_examples::mesh::Positions;

use super::camera::Camera;
use super::canvas::{Canvas, HEADING, TITLE};
use super::figures::{self, strain_colour};
use super::material::Colour;
use super::stage::{INK, PAPER, SUPER, Sample, Stage, View, redirect};
use super::strain::Surface;
use crate::bake::{Bake, Tile};
use crate::field::Field;

const COLUMN: usize = 640;
const GAP: usize = 20;
const MARGIN: usize = 28;
const BAR: usize = 64;
const LABEL: usize = 34;

/// Everything that stays the same from frame to frame.
pub struct Sheet<'a> {
    stage: &'a Stage<'a>,
    surfaces: Vec<Surface>,
    charts: Vec<u32>,
    camera: Camera,
    size: [usize; 2],
}

impl<'a> Sheet<'a> {
    pub fn new(stage: &'a Stage, bake: &Bake, view: Option<[f64; 2]>) -> Sheet<'a> {
        let Stage { triangles, owners, .. } = stage;
        let [camera] = Camera::turning(&stage.poses(), view, 1)[..] else { unreachable!("one camera") };
        let height = (COLUMN as f64 * camera.aspect()).clamp(0.74 * COLUMN as f64, 1.15 * COLUMN as f64);
        let surface = |(number, tile): (usize, &Tile)| {
            let all = (0u32..).zip(triangles).zip(owners);
            Surface::new(all.filter(|(_, owner)| **owner == number).map(|(own, _)| own), tile.cells)
        };
        let surfaces = bake.tiles.iter().enumerate().map(surface).collect();
        let charts = islands(triangles);
        Sheet { stage, surfaces, charts, camera, size: [COLUMN, height as usize] }
    }

    /// Draws a frame with each tile's redirection and figures.
    pub fn draw(
        &self,
        title: &str,
        pose: &Positions,
        maps: &[Field<3>],
        reports: &[TileReport],
    ) -> image::RgbImage {
        let Sheet { stage, camera, .. } = self;
        let pose = stage.near(pose);
        let [w, h] = self.size;
        let size = [2 * MARGIN + 3 * COLUMN + 2 * GAP, BAR + 2 * (LABEL + h) + GAP + MARGIN];
        let mut canvas = Canvas::new(size, PAPER);
        canvas.text([MARGIN, 22], TITLE, INK, title);
        let place = |column: usize, row: usize| {
            [MARGIN + column * (COLUMN + GAP), BAR + LABEL + row * (LABEL + h + GAP)]
        };
        let labels = [
            ["rest", "deformed, original UVs", "deformed, redirected UVs"],
            ["figures", "strain of rigid features: original", "strain of rigid features: redirected"],
        ];
        for (row, column) in (0..2).flat_map(|row| (0..3).map(move |column| (row, column))) {
            let [x, y] = place(column, row);
            canvas.text([x, y - LABEL + 4], HEADING, INK, labels[row][column]);
        }

        let [rest, posed] = [&stage.rest, &pose].map(|positions| stage.view(camera, positions, self.size));
        let redirected = |s: &Sample| redirect(&maps[s.tile], s.uv);
        let strained = |s: &Sample, target: &dyn Fn([f32; 2]) -> [f32; 2]| {
            let mesh = (stage.triangles.as_slice(), self.charts.as_slice());
            let strain = || self.surfaces[s.tile].strain(mesh, [&stage.rest, &pose], s.uv, target);
            stage.marked(s, target(s.uv), || strain().map(strain_colour))
        };
        let mut picture = |column, row, view: &View, shade: &(dyn Fn(&Sample) -> Colour + Sync)| {
            canvas.picture(place(column, row), self.size, SUPER, |x, y| {
                stage.sample(view, x, y).map_or(PAPER, |sample| shade(&sample))
            });
        };
        picture(0, 0, &rest, &|s| stage.painted(&rest, s, s.uv));
        picture(1, 0, &posed, &|s| stage.painted(&posed, s, s.uv));
        picture(2, 0, &posed, &|s| stage.painted(&posed, s, redirected(s)));
        picture(1, 1, &posed, &|s| strained(s, &|uv| uv));
        picture(2, 1, &posed, &|s| strained(s, &|uv| redirect(&maps[s.tile], uv)));
        figures::draw(&mut canvas, place(0, 1), [w, h], stage, posed.scale, maps, reports);
        canvas.finish()
    }
}
