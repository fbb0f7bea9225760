//! The maps of all pages while they are painted: strokes, fills and tools for whole maps.

use vrtm_examples::islands::islands;

use super::canvas::{Canvas, Rect};
use super::disc::{Part, disc};
use super::ids::Ids;
use super::kind::Brush;
use super::pick::Hit;
use super::steps::{Change, Steps};
use super::whole::{Tool, used};
use crate::model::{Model, length, minus};
use crate::solve::answer::{Maps, Solved};

/// A page's part in a stroke.
struct Touched {
    page: usize,
    /// The texels before it.
    before: Vec<u16>,
    /// Coverage of each texel by the stroke: parts of it that overlap do not add up.
    cover: Vec<f32>,
    rect: Rect,
}

/// The maps, and what happened to them.
#[derive(Default)]
pub struct Painter {
    /// Per page.
    pub canvases: Vec<Canvas>,
    /// Per tile: layers of a page have triangles of their own at a texel.
    ids: Vec<Option<Ids>>,
    /// The chart of each triangle.
    islands: Vec<u32>,
    stroke: Option<Vec<Touched>>,
    pub steps: Steps,
}

impl Painter {
    pub fn new(model: &Model) -> Painter {
        let canvases = model.pages.iter().map(|page| Canvas::new(page.rigidity.as_ref())).collect();
        Painter { canvases, ..Painter::default() }.for_model(model)
    }

    /// The same maps for a model with the same pages.
    pub fn for_model(self, model: &Model) -> Painter {
        let ids = model.tiles.iter().map(|_| None).collect();
        Painter { ids, islands: islands(&model.triangles), ..self }
    }

    /// Begins a stroke.
    pub fn begin(&mut self) {
        self.stroke = Some(Vec::new());
    }

    pub fn is_painting(&self) -> bool {
        self.stroke.is_some()
    }

    /// Paints around a point of the surface; `radius` in space. `seen` holds the results through which the texture is
    /// seen, or nothing for the original UVs.
    pub fn dab(
        &mut self,
        model: &Model,
        positions: &[[f32; 3]],
        seen: Option<&[Solved]>,
        hit: &Hit,
        (brush, radius): (&Brush, f32),
    ) -> Vec<Change> {
        let parts = disc(model, positions, hit.triangle, hit.position, radius);
        let mut dirty: Vec<(usize, Rect)> = Vec::new();
        for part in &parts {
            let tile = model.tile_of(part.triangle);
            let maps = seen.map(|seen| &*seen[tile].maps);
            if let Some(rect) = self.fill(model, positions, maps, (part, tile), hit.position, (brush, radius))
            {
                let page = model.tiles[tile].page;
                match dirty.iter_mut().find(|(of, _)| *of == page) {
                    Some((_, all)) => *all = all.with(rect),
                    None => dirty.push((page, rect)),
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
        (part, tile): (&Part, usize),
        centre: [f32; 3],
        (brush, radius): (&Brush, f32),
    ) -> Option<Rect> {
        let page = model.tiles[tile].page;
        let canvas = &mut self.canvases[page];
        let ids = self.ids[tile].get_or_insert_with(|| ids_of(model, tile, canvas.size));
        let stroke = self.stroke.get_or_insert_default();
        let touched = match stroke.iter().position(|touched| touched.page == page) {
            Some(k) => &mut stroke[k],
            None => {
                let (before, cover) = (canvas.texels.clone(), vec![0.0; canvas.texels.len()]);
                stroke.push(Touched { page, before, cover, rect: Rect { first: canvas.size, size: [0, 0] } });
                stroke.last_mut()?
            }
        };
        let [low, high] = texture_box(maps, part, canvas.size);
        let [first, last] = [canvas.texel([low[0], high[1]]), canvas.texel([high[0], low[1]])];
        let triangle = &model.triangles[part.triangle];
        let corners = triangle.vertices.map(|v| positions[v as usize]);
        let mut changed: Option<Rect> = None;
        for y in first[1]..=last[1] {
            for x in first[0]..=last[0] {
                let uv = canvas.uv([x, y]);
                let on = maps.map_or(uv, |maps| maps.warped(uv));
                if ids.at(on) != Some(part.triangle) {
                    continue;
                }
                let w = weights(triangle.uvs.map(|uv| uv.map(|x| x as f32)), on);
                let place = [0, 1, 2].map(|c| (0..3).map(|k| w[k] * corners[k][c]).sum());
                let cover = vrtm_paint::cover(length(minus(place, centre)) / radius, brush.softness);
                let k = canvas.index([x, y]);
                if cover > touched.cover[k] {
                    touched.cover[k] = cover;
                    let before = f32::from(touched.before[k]);
                    canvas.texels[k] = (before + (brush.target() - before) * cover).round() as u16;
                    changed = Some(Rect::around(changed, [x, y]));
                }
            }
        }
        if let Some(rect) = changed {
            touched.rect = if touched.rect.size == [0, 0] { rect } else { touched.rect.with(rect) };
        }
        changed
    }

    /// Takes other maps, which can be undone where they have as many texels.
    pub fn replace(&mut self, canvases: Vec<Canvas>) {
        self.end();
        let before = std::mem::replace(&mut self.canvases, canvases);
        if before.iter().zip(&self.canvases).any(|(before, now)| before.size != now.size) {
            self.ids.iter_mut().for_each(|ids| *ids = None);
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
        let (charts, page) = (self.charts(model, tile), model.tiles[tile].page);
        let value = brush.target().round() as u16;
        let texels = self.canvases[page].texels.iter().zip(charts);
        let texels = texels.map(|(&texel, of)| if of == Some(island) { value } else { texel }).collect();
        self.set(vec![(page, texels)])
    }

    /// Uses a tool on all maps; where several charts lie over one another, on those of the first layer. Returns what
    /// changed.
    pub fn change(&mut self, model: &Model, tool: Tool) -> Vec<Change> {
        let mut all = Vec::new();
        for page in 0..self.canvases.len() {
            let tile = model.tiles.partition_point(|tile| tile.page < page);
            let charts = self.charts(model, tile);
            all.push((page, used(tool, &self.canvases[page], &charts)));
        }
        self.set(all)
    }

    /// The chart of each texel of a tile.
    fn charts(&mut self, model: &Model, tile: usize) -> Vec<Option<u32>> {
        let canvas = &self.canvases[model.tiles[tile].page];
        let ids = self.ids[tile].get_or_insert_with(|| ids_of(model, tile, canvas.size));
        let texels = (0..canvas.size[1]).flat_map(|y| (0..canvas.size[0]).map(move |x| [x, y]));
        texels.map(|at| ids.at(canvas.uv(at)).map(|triangle| self.islands[triangle])).collect()
    }

    /// Takes the new texels of pages as one step. Returns what changed.
    pub(super) fn set(&mut self, pages: Vec<(usize, Vec<u16>)>) -> Vec<Change> {
        self.end();
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for (page, texels) in pages {
            let canvas = &mut self.canvases[page];
            let width = canvas.size[0] as usize;
            let differing = (0..texels.len()).filter(|&k| texels[k] != canvas.texels[k]);
            let at = |k: usize| [(k % width) as u32, (k / width) as u32];
            let rect = differing.fold(None, |rect, k| Some(Rect::around(rect, at(k))));
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
        let touched = self.stroke.take().unwrap_or_default();
        let before = |touched: Touched| {
            let Touched { page, before, rect, .. } = touched;
            let canvas = Canvas { texels: before, ..self.canvases[page].clone() };
            Change { page, rect, texels: canvas.copy(rect) }
        };
        let changes: Vec<_> = touched.into_iter().filter(|t| t.rect.size != [0, 0]).map(before).collect();
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

fn ids_of(model: &Model, tile: usize, size: [u32; 2]) -> Ids {
    let range = model.tiles[tile].range.clone();
    Ids::new(range.clone().zip(&model.triangles[range]), size)
}

/// The least and greatest UV of the texture that is seen on a part of a triangle, with a margin of a texel.
fn texture_box(maps: Option<&Maps>, part: &Part, size: [u32; 2]) -> [[f32; 2]; 2] {
    let margin = size.map(|side| 2.5 / side as f32);
    let [mut low, mut high] = [part.low, part.high];
    if let Some(maps) = maps {
        let texel = |uv: f32, c: usize, by: i64| {
            let side = maps.size[c];
            ((uv * side as f32).floor() as i64 + by).clamp(0, i64::from(side) - 1) as usize
        };
        let (mut least, mut most) = ([f32::MAX; 2], [f32::MIN; 2]);
        for y in texel(part.low[1], 1, -1)..=texel(part.high[1], 1, 1) {
            for x in texel(part.low[0], 0, -1)..=texel(part.high[0], 0, 1) {
                let delta = maps.delta[y * maps.size[0] as usize + x];
                least = [0, 1].map(|c| least[c].min(delta[c]));
                most = [0, 1].map(|c| most[c].max(delta[c]));
            }
        }
        low = [0, 1].map(|c| low[c] + least[c]);
        high = [0, 1].map(|c| high[c] + most[c]);
    }
    [[0, 1].map(|c| low[c] - margin[c]), [0, 1].map(|c| high[c] + margin[c])]
}

/// The weights of a triangle's corners at a UV.
fn weights([a, b, c]: [[f32; 2]; 3], uv: [f32; 2]) -> [f32; 3] {
    let side = |p: [f32; 2], q: [f32; 2]| (q[0] - p[0]) * (uv[1] - p[1]) - (q[1] - p[1]) * (uv[0] - p[0]);
    let w = [side(b, c), side(c, a), side(a, b)];
    let sum: f32 = w.iter().sum();
    if sum == 0.0 { [1.0, 0.0, 0.0] } else { w.map(|w| w / sum) }
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
        let corners = model.triangles[triangle].vertices.map(|v| model.rest[v as usize]);
        let position = [0, 1, 2].map(|c| corners.iter().map(|p| p[c]).sum::<f32>() / 3.0);
        (model, painter, Hit { triangle, position, normal: [0.0, 0.0, 1.0], depth: 1.0 })
    }

    const BRUSH: Brush = Brush { softness: 0.5, ..Brush::DEFAULT };

    #[test]
    fn a_dab_paints_a_disc_on_the_surface_and_nothing_else() {
        let (model, mut painter, hit) = scene();
        let radius = 0.2 * model.radius;
        painter.begin();
        let changes = painter.dab(&model, &model.rest, None, &hit, (&BRUSH, radius));
        painter.end();
        assert_eq!(changes.len(), 1);
        let canvas = &painter.canvases[0];
        assert_eq!(changes[0].texels, canvas.copy(changes[0].rect));
        let ids = painter.ids[0].as_ref().expect("painted");
        let (mut full, mut painted) = (0, 0);
        for y in 0..canvas.size[1] {
            for x in 0..canvas.size[0] {
                let value = canvas.texels[canvas.index([x, y])];
                let uv = canvas.uv([x, y]);
                if value == 0 {
                    continue;
                }
                let triangle = &model.triangles[ids.at(uv).expect("only charts are painted")];
                let w = weights(triangle.uvs.map(|uv| uv.map(|x| x as f32)), uv);
                let corners = triangle.vertices.map(|v| model.rest[v as usize]);
                let place = [0, 1, 2].map(|c| (0..3).map(|k| w[k] * corners[k][c]).sum());
                let distance = length(minus(place, hit.position));
                assert!(distance <= 1.001 * radius, "{x} {y}: {distance} of {radius}");
                painted += 1;
                full += u32::from(value == 65535);
            }
        }
        assert!(painted > 100 && full > 10 && full < painted, "{full} of {painted}");
    }

    #[test]
    fn a_stroke_covers_each_texel_once_and_is_undone_as_a_whole() {
        let (model, mut painter, hit) = scene();
        let brush = Brush { value: 0.5, ..BRUSH };
        let before = painter.canvases.clone();
        painter.begin();
        let radius = 0.2 * model.radius;
        painter.dab(&model, &model.rest, None, &hit, (&brush, radius));
        let once = painter.canvases.clone();
        let again = painter.dab(&model, &model.rest, None, &hit, (&brush, radius));
        assert!(again.is_empty() && painter.canvases == once, "soft edges must not harden");
        let wide = painter.dab(&model, &model.rest, None, &hit, (&brush, 1.5 * radius));
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
    fn erasing_takes_away() {
        let (model, mut painter, hit) = scene();
        painter.canvases[0].texels.fill(65535);
        painter.begin();
        let brush = Brush { erase: true, ..BRUSH };
        painter.dab(&model, &model.rest, None, &hit, (&brush, 0.2 * model.radius));
        assert!(painter.canvases[0].texels.contains(&0) && painter.canvases[0].texels.contains(&65535));
    }

    #[test]
    fn a_texture_that_is_seen_elsewhere_is_painted_where_it_is_seen() {
        let (model, mut painter, hit) = scene();
        let radius = 0.1 * model.radius;
        let mut plain = Painter::new(&model);
        plain.canvases = painter.canvases.clone();
        plain.dab(&model, &model.rest, None, &hit, (&BRUSH, radius));
        // Everything is seen half a tile's 32th to the right of where it was painted.
        let shift = 1.0 / 32.0;
        let size = [64, 64];
        let nodes = (0..65 * 65).map(|k| [(k % 65) as f32 / 64.0 + shift, (k / 65) as f32 / 64.0]).collect();
        let maps = Maps { size, delta: vec![[-shift, 0.0]; 64 * 64], warp: nodes };
        let seen = [Solved { maps: maps.into(), report: Default::default() }];
        painter.dab(&model, &model.rest, Some(&seen), &hit, (&BRUSH, radius));
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
