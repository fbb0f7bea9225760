//! The maps of all pages while they are painted: strokes, fills and tools for whole maps.

use vrtm_examples::islands::islands;

use super::canvas::{Canvas, Rect};
use super::kind::Brush;
use super::pick::Hit;
use super::steps::{Change, Steps};
use super::whole::{Tool, used};
use crate::model::Model;
use crate::solve::answer::{Maps, Solved};

/// A page's part in a stroke.
struct Touched {
    page: usize,
    /// The texels before it.
    before: Vec<u16>,
    /// Coverage of each texel by the stroke: parts of it that overlap do not add up.
    cover: Vec<f32>,
    /// The texels that it changed.
    rect: Option<Rect>,
}

/// The maps, and what happened to them.
#[derive(Default)]
pub struct Painter {
    /// Per page.
    pub canvases: Vec<Canvas>,
    /// The chart at each texel, per tile, once it is wanted: layers of a page have charts of their own there.
    charts: Vec<Option<Vec<Option<u32>>>>,
    /// The chart of each triangle.
    islands: Vec<u32>,
    stroke: Vec<Touched>,
    pub steps: Steps,
}

impl Painter {
    pub fn new(model: &Model) -> Painter {
        let canvases = model.pages.iter().map(|page| Canvas::new(page.rigidity.as_ref())).collect();
        Painter { canvases, ..Painter::default() }.for_model(model)
    }

    /// The same maps for a model with the same pages.
    pub fn for_model(self, model: &Model) -> Painter {
        let charts = vec![None; model.tiles.len()];
        Painter { charts, islands: islands(&model.triangles), ..self }
    }

    /// Goes on with a stroke: paints around points of the surface, with radii in space. `seen` holds the results
    /// through which the texture is seen, or nothing for the original UVs.
    pub fn dab(
        &mut self,
        model: &Model,
        positions: &[[f32; 3]],
        seen: Option<&[Solved]>,
        hits: &[(Hit, f32)],
        brush: &Brush,
    ) -> Vec<Change> {
        let mut dirty: Vec<(usize, Rect)> = Vec::new();
        for (hit, radius) in hits {
            let ball = (hit.position.into(), *radius);
            for triangle in model.surface.disc(positions, hit.triangle, ball) {
                let tile = model.tile_of(triangle);
                let maps = seen.map(|seen| &*seen[tile].maps);
                if let Some(rect) = self.fill(model, positions, maps, (triangle, tile), ball, brush) {
                    let page = model.tiles[tile].page;
                    match dirty.iter_mut().find(|(of, _)| *of == page) {
                        Some((_, all)) => *all = all.with(rect),
                        None => dirty.push((page, rect)),
                    }
                }
            }
        }
        let change = |(page, rect)| Change { page, rect, texels: self.canvases[page].copy(rect) };
        dirty.into_iter().map(change).collect()
    }

    /// Paints the texels that are seen on one triangle.
    fn fill(
        &mut self,
        model: &Model,
        positions: &[[f32; 3]],
        maps: Option<&Maps>,
        (triangle, tile): (usize, usize),
        ball: ([f32; 3], f32),
        brush: &Brush,
    ) -> Option<Rect> {
        let page = model.tiles[tile].page;
        let canvas = &mut self.canvases[page];
        let charts = self.charts[tile].get_or_insert_with(|| charts(model, &self.islands, tile, canvas.size));
        let stroke = &mut self.stroke;
        let touched = match stroke.iter().position(|touched| touched.page == page) {
            Some(k) => &mut stroke[k],
            None => {
                let (before, cover) = (canvas.texels.clone(), vec![0.0; canvas.texels.len()]);
                stroke.push(Touched { page, before, cover, rect: None });
                stroke.last_mut()?
            }
        };
        let size = canvas.size.map(|side| side as usize);
        let grid = maps.map_or(size, |maps| maps.size.map(|side| side as usize));
        // Rows of the map run upward.
        let delta =
            |x: usize, y: usize| maps.map_or([0.0; 2], |maps| maps.delta[(grid[1] - 1 - y) * grid[0] + x]);
        let mut changed: Option<Rect> = None;
        model.surface.fill((triangle, positions), ball, size, (grid, delta), |texel, away| {
            let cover = vrtm_paint::cover(away, brush.softness);
            // What lies beside a chart may be another's.
            if cover > touched.cover[texel] && charts[texel] == Some(self.islands[triangle]) {
                touched.cover[texel] = cover;
                let before = f32::from(touched.before[texel]);
                canvas.texels[texel] = (before + (brush.target() - before) * cover).round() as u16;
                changed = Some(Rect::around(changed, canvas.place(texel)));
                touched.rect = Some(Rect::around(touched.rect, canvas.place(texel)));
            }
        });
        changed
    }

    /// Takes other maps, which can be undone where they have as many texels.
    pub fn replace(&mut self, canvases: Vec<Canvas>) {
        self.end();
        let before = std::mem::replace(&mut self.canvases, canvases);
        if before.iter().zip(&self.canvases).any(|(before, now)| before.size != now.size) {
            self.charts.fill(None);
            return self.steps.clear();
        }
        let whole = |(page, canvas): (usize, Canvas)| {
            let rect = Rect { first: [0, 0], size: canvas.size };
            Change { page, rect, texels: canvas.texels }
        };
        self.steps.keep(before.into_iter().enumerate().map(whole).collect());
    }

    /// Gives all of the chart of a triangle one value. Returns what changed.
    pub fn fill_island(&mut self, model: &Model, triangle: usize, brush: &Brush) -> Vec<Change> {
        let (tile, island) = (model.tile_of(triangle), self.islands[triangle]);
        let page = model.tiles[tile].page;
        let value = brush.target().round() as u16;
        let texels = self.canvases[page].texels.clone();
        let texels = texels.into_iter().zip(self.charts(model, tile));
        let texels = texels.map(|(texel, of)| if *of == Some(island) { value } else { texel }).collect();
        self.set(vec![(page, texels)])
    }

    /// Uses a tool on all maps; where several charts lie over one another, on those of the first layer. Returns what
    /// changed.
    pub fn change(&mut self, model: &Model, tool: Tool) -> Vec<Change> {
        let mut all = Vec::new();
        for page in 0..self.canvases.len() {
            let tile = model.tiles.partition_point(|tile| tile.page < page);
            self.charts(model, tile);
            let charts = self.charts[tile].as_deref().unwrap_or_default();
            all.push((page, used(tool, &self.canvases[page], charts)));
        }
        self.set(all)
    }

    /// The chart of each texel of a tile.
    fn charts(&mut self, model: &Model, tile: usize) -> &[Option<u32>] {
        let size = self.canvases[model.tiles[tile].page].size;
        self.charts[tile].get_or_insert_with(|| charts(model, &self.islands, tile, size))
    }

    /// Takes the new texels of pages as one step. Returns what changed.
    pub(super) fn set(&mut self, pages: Vec<(usize, Vec<u16>)>) -> Vec<Change> {
        self.end();
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for (page, texels) in pages {
            let canvas = &mut self.canvases[page];
            let differing = (0..texels.len()).filter(|&k| texels[k] != canvas.texels[k]);
            let rect = differing.fold(None, |rect, k| Some(Rect::around(rect, canvas.place(k))));
            let Some(rect) = rect else { continue };
            before.push(Change { page, rect, texels: canvas.copy(rect) });
            canvas.texels = texels;
            after.push(Change { page, rect, texels: canvas.copy(rect) });
        }
        self.steps.keep(before);
        after
    }

    /// Ends a stroke, which can be undone from now on.
    pub fn end(&mut self) {
        let touched = std::mem::take(&mut self.stroke);
        let before = |Touched { page, before, rect, .. }: Touched| {
            let canvas = Canvas { texels: before, ..self.canvases[page] };
            rect.map(|rect| Change { page, rect, texels: canvas.copy(rect) })
        };
        let changes = touched.into_iter().filter_map(before).collect();
        self.steps.keep(changes);
    }

    /// Takes the last step back. Returns what changed.
    pub fn undo(&mut self) -> Vec<Change> {
        self.end();
        self.steps.undo(&mut self.canvases)
    }

    /// Does it again.
    pub fn redo(&mut self) -> Vec<Change> {
        self.end();
        self.steps.redo(&mut self.canvases)
    }
}

/// The chart at each texel of a tile: texels beside charts belong to them unless they lie in another.
fn charts(model: &Model, islands: &[u32], tile: usize, size: [u32; 2]) -> Vec<Option<u32>> {
    let size = size.map(|side| side as usize);
    let mut all = vec![None; size[0] * size[1]];
    for margin in [vrtm_paint::MARGIN, 0.01] {
        for triangle in model.tiles[tile].range.clone() {
            model.surface.texels(triangle, margin, size, |texel| all[texel] = Some(islands[triangle]));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scene with empty maps, and a point on it.
    fn scene() -> (Model, Painter, Hit) {
        let model = Model::scene("mug_to_jug");
        let mut painter = Painter::new(&model);
        painter.canvases[0].texels.fill(0);
        let triangle = model.triangles.len() / 3;
        let hit = Hit::new(&model, &model.rest, (triangle, [1.0 / 3.0; 3]));
        (model, painter, hit)
    }

    const BRUSH: Brush = Brush { softness: 0.5, ..Brush::DEFAULT };

    #[test]
    fn a_dab_paints_a_disc_on_the_surface_and_nothing_else() {
        let (model, mut painter, hit) = scene();
        let radius = 0.2 * model.radius;
        let changes = painter.dab(&model, &model.rest, None, &[(hit, radius)], &BRUSH);
        painter.end();
        assert_eq!(changes.len(), 1);
        let canvas = &painter.canvases[0];
        assert_eq!(changes[0].texels, canvas.copy(changes[0].rect));
        let charts = painter.charts[0].as_ref().expect("painted");
        let painted = (0..canvas.texels.len()).filter(|&k| canvas.texels[k] > 0);
        assert!(painted.clone().all(|k| charts[k].is_some()), "only charts are painted");
        let full = painted.clone().filter(|&k| canvas.texels[k] == 65535).count();
        let painted = painted.count();
        assert!(painted > 100 && full > 10 && full < painted, "{full} of {painted}");
    }

    #[test]
    fn a_stroke_covers_each_texel_once_and_is_undone_as_a_whole() {
        let (model, mut painter, hit) = scene();
        let brush = Brush { value: 0.5, ..BRUSH };
        let before = painter.canvases.clone();
        let radius = 0.2 * model.radius;
        painter.dab(&model, &model.rest, None, &[(hit, radius)], &brush);
        let once = painter.canvases.clone();
        let again = painter.dab(&model, &model.rest, None, &[(hit, radius)], &brush);
        assert!(again.is_empty() && painter.canvases == once, "soft edges must not harden");
        let wide = painter.dab(&model, &model.rest, None, &[(hit, 1.5 * radius)], &brush);
        assert!(!wide.is_empty());
        painter.end();
        assert!(painter.steps.can_undo());
        let after = painter.canvases.clone();
        painter.undo();
        assert!(painter.canvases == before && !painter.steps.can_undo());
        painter.redo();
        assert!(painter.canvases == after && painter.steps.can_undo());
    }

    #[test]
    fn a_fill_covers_the_chart_alone_and_is_one_step() {
        let (model, mut painter, hit) = scene();
        let other = |k: &usize| painter.islands[*k] != painter.islands[hit.triangle];
        let beside = (0..model.triangles.len()).find(other).expect("the mug has several charts");
        let changes = painter.fill_island(&model, hit.triangle, &BRUSH);
        assert_eq!(changes.len(), 1);
        let value = |painter: &Painter, triangle: usize| {
            let canvas = &painter.canvases[0];
            let uvs = model.triangles[triangle].uvs;
            let uv = [0, 1].map(|c| (uvs.iter().map(|uv| uv[c]).sum::<f64>() / 3.0) as f32);
            canvas.texels[canvas.index(canvas.texel(uv))]
        };
        assert_eq!([hit.triangle, beside].map(|k| value(&painter, k)), [65535, 0]);
        painter.change(&model, Tool::Invert);
        assert_eq!([hit.triangle, beside].map(|k| value(&painter, k)), [0, 65535]);
        painter.undo();
        painter.undo();
        assert!(!painter.steps.can_undo() && painter.canvases[0].texels.iter().all(|&texel| texel == 0));
    }

    #[test]
    fn a_texture_that_is_seen_elsewhere_is_painted_where_it_is_seen() {
        let (model, mut painter, hit) = scene();
        let radius = 0.1 * model.radius;
        let mut plain = Painter::new(&model);
        plain.canvases = painter.canvases.clone();
        plain.dab(&model, &model.rest, None, &[(hit, radius)], &BRUSH);
        // Everything is seen half a tile's 32th to the right of where it was painted.
        let shift = 1.0 / 32.0;
        let size = [64, 64];
        let maps = Maps { size, delta: vec![[-shift, 0.0]; 64 * 64], warp: Vec::new() };
        let seen = [Solved { maps: maps.into(), report: Default::default() }];
        painter.dab(&model, &model.rest, Some(&seen), &[(hit, radius)], &BRUSH);
        let columns = shift * painter.canvases[0].size[0] as f32;
        let centre = |canvas: &Canvas| {
            let weight = |k: usize| f64::from(canvas.texels[k]);
            let sum: f64 = (0..canvas.texels.len()).map(weight).sum();
            let x = |k: usize| (k % canvas.size[0] as usize) as f64;
            (0..canvas.texels.len()).map(|k| x(k) * weight(k)).sum::<f64>() / sum
        };
        let moved = centre(&plain.canvases[0]) - centre(&painter.canvases[0]);
        assert!((moved - f64::from(columns)).abs() < 0.5, "{moved} instead of {columns} texels");
    }
}
