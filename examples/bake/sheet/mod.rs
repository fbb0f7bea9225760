//! Draws the sheet of a frame: rest, deformed and corrected side by side, the strain as colours below, and the figures.

mod camera;
mod canvas;
mod material;
mod raster;
mod strain;

use crate::bake::Bake;
use crate::maps::Field;
use crate::mesh::{Positions, Triangle, cross, dot, minus};
use crate::report;
use crate::source::Source;
use camera::Camera;
use canvas::{Canvas, HEADING, TEXT, TITLE};
use material::{Colour, Material, mix, step};
use raster::Raster;
use strain::Surface;

const COLUMN: usize = 640;
const GAP: usize = 20;
const MARGIN: usize = 28;
const BAR: usize = 64;
const LABEL: usize = 34;
/// Samples per pixel along each axis.
const SUPER: usize = 2;
/// Side of a texture's thumbnail in pixels.
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

/// Everything that stays the same from frame to frame.
pub struct Stage<'a> {
    source: &'a Source,
    rest: Vec<[f32; 3]>,
    triangles: Vec<Triangle>,
    /// Index of each triangle's tile.
    owners: Vec<usize>,
    materials: Vec<Material>,
    surfaces: Vec<Surface>,
    charts: Vec<u32>,
    camera: Camera,
    size: [usize; 2],
}

/// A pose as seen by the camera.
struct View {
    raster: Raster,
    /// Normals of the vertices in view space (right, up, toward the viewer), on the side that is meant to be seen.
    normals: Vec<[f64; 3]>,
}

/// The surface at a sample.
struct Sample {
    tile: usize,
    uv: [f32; 2],
    /// Unit normal toward the viewer, in view space.
    normal: [f32; 3],
    /// True if the surface is seen from inside.
    inside: bool,
}

impl<'a> Stage<'a> {
    pub fn new(source: &'a Source, bake: &Bake, view: Option<[f64; 2]>) -> Stage<'a> {
        let rest = near(source, &source.mesh.rest);
        let mut triangles = source.mesh.triangles();
        let owner = |t: &Triangle| bake.tiles.iter().position(|tile| tile.udim == t.udim);
        triangles.retain(|t| owner(t).is_some());
        let owners: Vec<usize> = triangles.iter().filter_map(owner).collect();
        let poses: Vec<_> = source.frames.iter().map(|frame| near(source, &frame.positions)).collect();
        let all: Vec<&[[f32; 3]]> = std::iter::once(&rest).chain(&poses).map(Vec::as_slice).collect();
        let camera = Camera::new(&all, view);
        let height = (COLUMN as f64 * camera.aspect()).clamp(0.74 * COLUMN as f64, 1.15 * COLUMN as f64);
        let size = [COLUMN, height as usize];
        let of = |tile: usize| {
            (0u32..).zip(triangles.iter().zip(&owners)).filter(move |(_, (_, owner))| **owner == tile)
        };
        let material = |(tile, baked): (usize, &crate::bake::Tile)| {
            let areas = of(tile).fold([0.0; 2], |[texture, surface], (_, (t, _))| {
                let [a, b, c] = t.uvs.map(|[u, v]| [u, v, 0.0]);
                let [p, q, r] = t.vertices.map(|v| rest[v as usize].map(f64::from));
                let area =
                    |a, b, c| cross(minus(b, a), minus(c, a)).map(|x| x * x).iter().sum::<f64>().sqrt();
                [texture + area(a, b, c), surface + area(p, q, r)]
            });
            Material::new(baked.rigidity, camera.scale(size) * (areas[1] / areas[0].max(1e-30)).sqrt())
        };
        let materials = bake.tiles.iter().enumerate().map(material).collect();
        let surface = |(tile, baked): (usize, &crate::bake::Tile)| {
            Surface::new(of(tile).map(|(index, (t, _))| (index, t)), baked.cells)
        };
        let surfaces = bake.tiles.iter().enumerate().map(surface).collect();
        let charts = strain::charts(&triangles, source.mesh.uvs.len());
        Stage { source, rest, owners, materials, surfaces, charts, camera, size, triangles }
    }

    /// Draws a frame with each tile's redirection, and lines of figures.
    pub fn draw(
        &self,
        title: &str,
        pose: &Positions,
        maps: &[Field<3>],
        figures: &[String],
    ) -> image::RgbImage {
        let pose = near(self.source, pose);
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

        let (rest, posed) = (self.view(&self.rest), self.view(&pose));
        let painted = |tile: usize, uv: [f32; 2]| self.materials[tile].colour(uv);
        let target = |s: &Sample| redirect(&maps[s.tile], s.uv);
        let strained = |s: &Sample, target: &dyn Fn([f32; 2]) -> [f32; 2]| {
            let rigid = step(0.25, 0.40, self.materials[s.tile].rigidity(target(s.uv)));
            let mesh = (self.triangles.as_slice(), self.charts.as_slice());
            let strain = || self.surfaces[s.tile].strain(mesh, [&self.rest, &pose], s.uv, target);
            let colour = if rigid > 0.0 { strain() } else { None }
                .map_or(QUIET, |strain| mix(QUIET, strain_colour(strain), rigid));
            soft_light(colour, s)
        };
        let mut picture = |column, row, view: &View, shade: &(dyn Fn(&Sample) -> Colour + Sync)| {
            canvas.picture(place(column, row), self.size, SUPER, |x, y| {
                self.sample(view, x, y).map_or(PAPER, |sample| shade(&sample))
            });
        };
        picture(0, 0, &rest, &|s| light(painted(s.tile, s.uv), s));
        picture(1, 0, &posed, &|s| light(painted(s.tile, s.uv), s));
        picture(2, 0, &posed, &|s| light(painted(s.tile, target(s)), s));
        picture(1, 1, &posed, &|s| strained(s, &|uv| uv));
        picture(2, 1, &posed, &|s| strained(s, &|uv| redirect(&maps[s.tile], uv)));

        let [left, top] = place(0, 1);
        for (i, line) in std::iter::once(report::TITLES).chain(figures.iter().map(String::as_str)).enumerate()
        {
            canvas.text([left, top + 4 + 20 * i], TEXT, INK, line);
        }
        // With several tiles the sheet has no room for their textures.
        if let [map] = maps {
            let side = (THUMB * SUPER) as f32;
            let uv = |x: usize, y: usize| [(x as f32 + 0.5) / side, 1.0 - (y as f32 + 0.5) / side];
            let corners = [[left, top + 60], [left + w - THUMB, top + 60]];
            canvas.picture(corners[0], [THUMB; 2], SUPER, |x, y| painted(0, uv(x, y)));
            canvas.picture(corners[1], [THUMB; 2], SUPER, |x, y| painted(0, redirect(map, uv(x, y))));
            for ([x, y], label) in
                corners.into_iter().zip(["texture as painted", "texture as it is looked up"])
            {
                canvas.text([x, y + THUMB + 6], TEXT, INK, label);
            }
        }
        legend(&mut canvas, [left, top + h - 44]);
        canvas.finish()
    }

    fn view(&self, positions: &[[f32; 3]]) -> View {
        let size = self.size.map(|n| n * SUPER);
        let screen: Vec<[f64; 3]> = positions.iter().map(|&p| self.camera.project(p, size)).collect();
        let corners = |t: &Triangle| t.vertices.map(|v| screen[v as usize]);
        let raster = Raster::new((0..).zip(self.triangles.iter().map(corners)), size);

        let seen: Vec<[f64; 3]> = positions.iter().map(|&p| self.camera.view(p)).collect();
        let mut normals = vec![[0.0; 3]; positions.len()];
        // The sign of the enclosed volume tells whether the faces' winding points outward. Positions are relative to a
        // point of the mesh, since far from the origin the sum would be lost to rounding.
        let mut volume = 0.0;
        for t in &self.triangles {
            let [a, b, c] = t.vertices.map(|v| seen[v as usize]);
            let normal = cross(minus(b, a), minus(c, a));
            volume += dot(normal, minus(a, seen[0]));
            for v in t.vertices {
                normals[v as usize] = minus(normals[v as usize], normal.map(|x| -x));
            }
        }
        let sign = if volume < 0.0 { -1.0 } else { 1.0 };
        View { raster, normals: normals.into_iter().map(|n| n.map(|x| x * sign)).collect() }
    }

    fn sample(&self, view: &View, x: usize, y: usize) -> Option<Sample> {
        let (triangle, weights) = view.raster.hits[y * view.raster.size[0] + x]?;
        let t = &self.triangles[triangle as usize];
        let weights = weights.map(f64::from);
        let uv = [0, 1].map(|c| (0..3).map(|k| weights[k] * t.uvs[k][c]).sum::<f64>() as f32);
        let corners = t.vertices.map(|v| view.normals[v as usize]);
        let normal = [0, 1, 2].map(|c| (0..3).map(|k| weights[k] * corners[k][c]).sum::<f64>());
        let inside = normal[2] < 0.0;
        let length = dot(normal, normal).sqrt().max(1e-30) * if inside { -1.0 } else { 1.0 };
        let normal = normal.map(|x| (x / length) as f32);
        Some(Sample { tile: self.owners[triangle as usize], uv, normal, inside })
    }
}

/// A pose in f32, as pictures are drawn.
fn near(source: &Source, pose: &Positions) -> Vec<[f32; 3]> {
    pose.around(pose.origin(&source.mesh.rest))
}

/// The redirected UV. Deltas are interpolated, because they are zero at a chart's border and smooth inside.
fn redirect(map: &Field<3>, uv: [f32; 2]) -> [f32; 2] {
    let target = map.sample(uv);
    [0, 1].map(|c| {
        let half = 0.5 / map.size[c] as f32;
        uv[c] + target[c] - uv[c].clamp(half, 1.0 - half)
    })
}

/// Light from the upper left.
fn key([x, y, z]: [f32; 3]) -> f32 {
    (-0.45 * x + 0.55 * y + 0.70 * z).max(0.0)
}

/// Shades a colour with the key light and light from the sky.
fn light(colour: Colour, s: &Sample) -> Colour {
    let (key, sky) = (key(s.normal), 0.5 + 0.5 * s.normal[1]);
    let strength = (0.80 * key + 0.20 * sky + 0.10) * if s.inside { 0.45 } else { 1.0 };
    // A small, strong highlight, as glaze has it.
    colour.map(|c| c * strength + key.powi(40) * 0.22)
}

/// Shades flat enough to read colours from, but varied enough to show the shape.
fn soft_light(colour: Colour, s: &Sample) -> Colour {
    let strength = (0.68 + 0.32 * key(s.normal)) * if s.inside { 0.7 } else { 1.0 };
    colour.map(|c| c * strength)
}

/// Colour of a strain: white for none, red for stretch, blue for compression, violet for both (shear).
fn strain_colour([stretch, squeeze]: [f32; 2]) -> Colour {
    let (a, b) = ((stretch / FULL).min(1.0), (squeeze / FULL).min(1.0));
    mix(mix([0.92; 3], STRETCH, a), mix(SQUEEZE, SHEAR, a), b)
}

fn legend(canvas: &mut Canvas, [left, top]: [usize; 2]) {
    canvas.picture([left, top], [360, 18], 1, |x, _| {
        let strain = (x as f32 / 180.0 - 1.0) * FULL;
        strain_colour([strain.max(0.0), (-strain).max(0.0)])
    });
    canvas.picture([left + 400, top], [36, 18], 1, |x, _| strain_colour([x as f32 / 36.0 * FULL; 2]));
    for (x, text) in [(0, "-30 % squeezed"), (176, "0"), (232, "stretched +30 %"), (400, "both (sheared)")] {
        canvas.text([left + x, top + 22], TEXT, INK, text);
    }
}
