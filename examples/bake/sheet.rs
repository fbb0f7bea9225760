//! The sheet of a frame: rest, deformed and corrected side by side, the strain as colours below, and the figures.

use vrtm::TileReport;

use crate::camera::Camera;
use crate::canvas::{Canvas, HEADING, LARGE, TEXT, TITLE};
use crate::figures;
use crate::maps::{Field, Map};
use crate::material::{Colour, Material, mix, step};
use crate::mesh::{Mesh, Triangle};
use crate::raster::{Hit, SUPER, Samples, rasterise};
use crate::strain::{self, StrainMaps};

const COLUMN: usize = 640;
const GAP: usize = 20;
const MARGIN: usize = 28;
const BAR: usize = 64;
const LABEL: usize = 34;
/// Side of the picture of a texture in pixels.
const THUMB: usize = 300;
const PAPER: Colour = [0.80, 0.80, 0.78];
const INK: Colour = [0.012, 0.012, 0.016];
/// Colour of elastic material in the strain pictures.
const QUIET: Colour = [0.16, 0.16, 0.165];
const STRETCH: Colour = [0.72, 0.015, 0.020];
const SQUEEZE: Colour = [0.020, 0.085, 0.72];
const SHEAR: Colour = [0.24, 0.015, 0.40];
/// Strain at which the colour is saturated.
const FULL: f32 = 0.30;

/// All that does not change from frame to frame.
pub struct Stage<'a> {
    mesh: &'a Mesh,
    triangles: Vec<Triangle>,
    charts: Vec<u32>,
    /// UDIM numbers in ascending order, which is the order of the materials and of each frame's tiles.
    udims: Vec<u32>,
    materials: Vec<Material>,
    /// Index of each triangle into `udims`.
    tiles: Vec<usize>,
    camera: Camera,
    size: [usize; 2],
    rest: Samples,
    threads: usize,
}

/// Result of one tile.
pub struct TileResult {
    pub redirect: Field<2>,
    pub warp: Field<2>,
    pub report: TileReport,
}

impl<'a> Stage<'a> {
    /// `tiles` holds each tile's UDIM number and rigidity map in ascending order; `poses` are the poses to be drawn.
    pub fn new(
        mesh: &'a Mesh,
        tiles: &[(u32, Option<&Map>)],
        poses: &[&[[f32; 3]]],
        args: &crate::args::Args,
        threads: usize,
    ) -> Stage<'a> {
        let udims: Vec<u32> = tiles.iter().map(|tile| tile.0).collect();
        let mut triangles = mesh.triangles();
        triangles.retain(|t| udims.contains(&t.udim));
        let index = |t: &Triangle| udims.iter().position(|&udim| udim == t.udim).expect("retained");
        let owners: Vec<usize> = triangles.iter().map(index).collect();
        let mut materials: Vec<Material> = tiles.iter().map(|tile| Material::new(tile.1)).collect();
        let rigid = triangles.iter().zip(&owners).map(|(t, &tile)| {
            let centre = [0, 1].map(|k| (t.uvs.iter().map(|uv| uv[k]).sum::<f64>() / 3.0) as f32);
            let points = t.uvs.map(|uv| uv.map(|x| x as f32)).into_iter().chain([centre]);
            points.map(|uv| materials[tile].rigidity(uv)).sum::<f32>() / 4.0
        });
        let rigid: Vec<f32> = rigid.collect();
        let all: Vec<&[[f32; 3]]> =
            std::iter::once(mesh.rest.as_slice()).chain(poses.iter().copied()).collect();
        let camera = Camera::choose(&triangles, &rigid, &all, args.view, args.up);
        let height = (COLUMN as f64 * camera.aspect()).clamp(0.74 * COLUMN as f64, 1.15 * COLUMN as f64);
        let size = [COLUMN, height as usize];
        let scale = camera.scale(size[0] as f64, size[1] as f64);
        for (tile, material) in materials.iter_mut().enumerate() {
            let own = triangles.iter().zip(&owners).filter(|(_, owner)| **owner == tile);
            let (texture, surface) = own.fold((0.0, 0.0), |(texture, surface), (t, _)| {
                (texture + t.uv_area(), surface + t.area(&mesh.rest))
            });
            if texture > 0.0 {
                material.set_scale((scale * (surface / texture).sqrt()) as f32);
            }
        }
        let rest = rasterise(&triangles, &mesh.rest, &camera, size[0], size[1]);
        let charts = strain::charts(&triangles, mesh.uvs.len());
        Stage { mesh, triangles, charts, udims, materials, tiles: owners, camera, size, rest, threads }
    }

    /// Draws a frame.
    pub fn draw(&self, title: &str, pose: &[[f32; 3]], results: &[TileResult]) -> image::RgbImage {
        let posed = rasterise(&self.triangles, pose, &self.camera, self.size[0], self.size[1]);
        let strains: Vec<StrainMaps> =
            (0..self.udims.len()).map(|i| self.strain(i, pose, &results[i].warp)).collect();
        let redirected = |tile: usize, uv: [f32; 2]| redirect(&results[tile].redirect, uv);
        let painted = |tile: usize, uv: [f32; 2]| self.materials[tile].colour(uv);
        let strained = |field: &Field<3>, tile: usize, uv: [f32; 2]| {
            let rigid = step(0.25, 0.40, self.materials[tile].rigidity(uv));
            strain::sample(field, uv).map_or(QUIET, |strain| mix(QUIET, strain_colour(strain), rigid))
        };

        let [w, h] = self.size;
        let width = 2 * MARGIN + 3 * COLUMN + 2 * GAP;
        let mut canvas = Canvas::new(width, BAR + 2 * (LABEL + h) + GAP + MARGIN, PAPER);
        canvas.text([MARGIN, 22], width - 2 * MARGIN, TITLE, INK, title);
        let column = |i: usize| MARGIN + i * (COLUMN + GAP);
        let (top, below) = (BAR + LABEL, BAR + 2 * LABEL + h + GAP);
        let labels = [
            ["rest", "deformed, original UVs", "deformed, redirected UVs"],
            ["figures", "strain of rigid features: original", "strain of rigid features: redirected"],
        ];
        for (row, y) in [top, below].into_iter().enumerate() {
            for (i, label) in labels[row].iter().enumerate() {
                canvas.text([column(i), y - LABEL + 4], w, HEADING, INK, label);
            }
        }
        self.picture(&mut canvas, [column(0), top], &self.rest, |tile, hit| {
            light(painted(tile, hit.uv), hit)
        });
        self.picture(&mut canvas, [column(1), top], &posed, |tile, hit| light(painted(tile, hit.uv), hit));
        self.picture(&mut canvas, [column(2), top], &posed, |tile, hit| {
            light(painted(tile, redirected(tile, hit.uv)), hit)
        });
        self.picture(&mut canvas, [column(1), below], &posed, |tile, hit| {
            soft_light(strained(&strains[tile].before, tile, hit.uv), hit)
        });
        self.picture(&mut canvas, [column(2), below], &posed, |tile, hit| {
            soft_light(strained(&strains[tile].after, tile, redirected(tile, hit.uv)), hit)
        });
        let reports: Vec<TileReport> = results.iter().map(|r| r.report).collect();
        let lines = figures::lines(&reports);
        let (font, step) = if results.len() == 1 { (LARGE, 23) } else { (TEXT, 20) };
        for (i, line) in lines.iter().enumerate() {
            canvas.text([column(0), below + 4 + step * i], w, font, INK, line);
        }
        if results.len() == 1 {
            let left = column(0) + w - THUMB;
            texture(&mut canvas, [left, below + 8], "texture as it is looked up", |uv| {
                painted(0, redirected(0, uv))
            });
            let second = THUMB + 32;
            if 2 * second < h - 60 {
                texture(&mut canvas, [left, below + 8 + second], "texture as painted", |uv| painted(0, uv));
            }
        }
        legend(&mut canvas, [column(0), below + h - 44]);
        canvas.finish()
    }

    fn strain(&self, tile: usize, pose: &[[f32; 3]], warp: &Field<2>) -> StrainMaps {
        let own = || (0..self.triangles.len()).filter(|&i| self.tiles[i] == tile);
        let triangles: Vec<&Triangle> = own().map(|i| &self.triangles[i]).collect();
        let charts: Vec<u32> = own().map(|i| self.charts[i]).collect();
        strain::measure(&triangles, &charts, &self.mesh.rest, pose, &self.materials[tile], warp)
    }

    /// Shades samples and averages them to pixels; `texture` returns a tile's colour at a UV.
    fn picture(
        &self,
        canvas: &mut Canvas,
        at: [usize; 2],
        samples: &Samples,
        shade: impl Fn(usize, &Hit) -> Colour + Sync,
    ) {
        let [w, h] = self.size;
        let mut picture = vec![PAPER; w * h];
        let rows = h.div_ceil(self.threads);
        let shade_row = |y: usize, row: &mut [Colour]| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let mut sum = [0.0; 3];
                for k in 0..SUPER * SUPER {
                    let hit = &samples.hits[(y * SUPER + k / SUPER) * samples.width + x * SUPER + k % SUPER];
                    let colour = if hit.triangle == Hit::NOTHING {
                        PAPER
                    } else {
                        shade(self.tiles[hit.triangle as usize], hit)
                    };
                    sum = [0, 1, 2].map(|c| sum[c] + colour[c] / (SUPER * SUPER) as f32);
                }
                *pixel = sum;
            }
        };
        std::thread::scope(|scope| {
            for (band, pixels) in picture.chunks_mut(rows * w).enumerate() {
                let shade_row = &shade_row;
                scope.spawn(move || {
                    for (y, row) in pixels.chunks_mut(w).enumerate() {
                        shade_row(band * rows + y, row);
                    }
                });
            }
        });
        for (i, colour) in picture.into_iter().enumerate() {
            canvas.put(at[0] + i % w, at[1] + i / w, colour);
        }
    }
}

/// Shading that is flat enough to read colours from, and varied enough to show the shape.
fn soft_light(colour: Colour, hit: &Hit) -> Colour {
    let [x, y, z] = hit.normal;
    let key = (-0.45 * x + 0.55 * y + 0.70 * z).max(0.0);
    let strength = (0.68 + 0.32 * key) * if hit.inside { 0.7 } else { 1.0 };
    colour.map(|c| c * strength)
}

/// The redirected UV. Deltas are interpolated, because they are zero at a chart's border and smooth inside.
fn redirect(map: &Field<2>, uv: [f32; 2]) -> [f32; 2] {
    let centre = |x: f32, size: usize| x.clamp(0.5 / size as f32, 1.0 - 0.5 / size as f32);
    let clamped = [centre(uv[0], map.width), centre(uv[1], map.height)];
    let target = map.sample(uv);
    [0, 1].map(|c| uv[c] + target[c] - clamped[c])
}

/// Light from the upper left and from the sky.
fn light(colour: Colour, hit: &Hit) -> Colour {
    let [x, y, z] = hit.normal;
    let key = (-0.45 * x + 0.55 * y + 0.70 * z).max(0.0);
    let sky = 0.5 + 0.5 * y;
    let gloss = key.powi(24) * 0.05;
    let strength = (0.80 * key + 0.20 * sky + 0.10) * if hit.inside { 0.45 } else { 1.0 };
    colour.map(|c| c * strength + gloss)
}

/// Colour of a strain: white without, red for stretch, blue for compression, violet for both (shear).
fn strain_colour([stretch, squeeze]: [f32; 2]) -> Colour {
    let (a, b) = ((stretch / FULL).min(1.0), (squeeze / FULL).min(1.0));
    mix(mix([0.92; 3], STRETCH, a), mix(SQUEEZE, SHEAR, a), b)
}

/// Draws a tile's texture in the UV plane.
fn texture(canvas: &mut Canvas, at: [usize; 2], label: &str, colour: impl Fn([f32; 2]) -> Colour) {
    let side = (THUMB * SUPER) as f32;
    canvas.rectangle(at, [THUMB, THUMB], |x, y| {
        let mut sum = [0.0; 3];
        for k in 0..SUPER * SUPER {
            let shift = |i: usize| (i as f32 - 0.5) / side;
            let part = colour([x + shift(k % SUPER), 1.0 - y - shift(k / SUPER)]);
            sum = [0, 1, 2].map(|c| sum[c] + part[c] / (SUPER * SUPER) as f32);
        }
        sum
    });
    canvas.text([at[0], at[1] + THUMB + 6], THUMB, TEXT, INK, label);
}

fn legend(canvas: &mut Canvas, at: [usize; 2]) {
    let (bar, swatch) = ([360, 18], [at[0] + 400, at[1]]);
    canvas.rectangle(at, bar, |x, _| {
        let strain = (2.0 * x - 1.0) * FULL;
        strain_colour([strain.max(0.0), (-strain).max(0.0)])
    });
    canvas.rectangle(swatch, [36, 18], |x, _| strain_colour([x * FULL, x * FULL]));
    let texts =
        [(0, "-30 % squeezed"), (176, "0"), (232, "stretched +30 %"), (swatch[0] - at[0], "both (sheared)")];
    for (x, text) in texts {
        canvas.text([at[0] + x, at[1] + 22], 240, TEXT, INK, text);
    }
}
