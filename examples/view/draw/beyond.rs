//! What textures show beside charts where seams continue: the copies that are drawn with have there what the surface
//! shows beyond the seam, as `vrtm dilate` writes it.

use image::RgbaImage;
use vrtm::{Asset, Backend, Device, DeviceSettings, ImageViewMut, Origin, Results, TileSettings};

use crate::brush::canvas::{Canvas, Rect};
use crate::model::{Model, mesh_source};
use crate::pictures::{self, Textures};

/// Reach over the borders of charts, at least: as far as `vrtm dilate` goes.
const REACH: f64 = 0.0625;
/// Texels per side of the map of places, and most of a texture.
const SIDE: u32 = 2048;
const LARGEST: u32 = 4096;

/// Reach of textures for these settings: in few steps, so that a slider does not dilate again and again.
pub fn reach(settings: &TileSettings) -> Option<f64> {
    let needed = f64::from(settings.seam_reach);
    let doubled = (0..4).map(|k| REACH * f64::from(1 << k)).find(|&reach| reach >= needed);
    (settings.seams == vrtm::Seams::Continue).then_some(doubled.unwrap_or(0.5))
}

/// Finds what lies beyond the seams of a mesh.
pub struct Beyond {
    results: Results,
    /// For each page, the tile of the asset; `None` if its triangles have no area.
    tiles: Vec<Option<usize>>,
    udims: Vec<u32>,
    reach: f64,
    /// The gutters of the maps.
    of_maps: Vec<Option<Gutter>>,
}

/// The texels beside the charts of an image that show what lies beyond a seam. Rows run from v = 0 upward.
struct Gutter {
    size: [u32; 2],
    /// True for each texel in a chart.
    inside: Vec<bool>,
    texels: Vec<Texel>,
}

/// A texel in a gutter.
struct Texel {
    index: usize,
    /// The page with its content, and where.
    page: usize,
    uv: [f32; 2],
    /// Derivatives of that place, by texel to the right and up.
    by: [[f32; 2]; 2],
}

impl Beyond {
    /// # Errors
    /// Those of vrtm.
    pub fn new(model: &Model, canvases: &[Canvas], reach: f64) -> vrtm::Result<Beyond> {
        let device = Device::new(&DeviceSettings { backend: Backend::Cpu, ..DeviceSettings::default() })?;
        let asset = Asset::new(&device, &mesh_source(&model.mesh, &model.rest, model.layers))?;
        let udims: Vec<u32> = model.pages.iter().map(|page| page.udim).collect();
        let tiles = udims.iter().map(|&udim| asset.find_tile(udim)).collect();
        let results = asset.results().clone();
        let mut beyond = Beyond { results, tiles, udims, reach, of_maps: Vec::new() };
        let sizes: Vec<_> = canvases.iter().map(|canvas| Some(canvas.size)).collect();
        beyond.of_maps = beyond.gutters(&sizes)?;
        Ok(beyond)
    }

    /// The reach that it was made for.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// The continued surface: for each texel the UV among all tiles, and a flag if it is known.
    fn places(&self, page: usize, size: [u32; 2]) -> vrtm::Result<Option<Vec<[f32; 4]>>> {
        let Some(tile) = self.tiles[page] else { return Ok(None) };
        let mut texels = vec![[0.0f32; 4]; size[0] as usize * size[1] as usize];
        let image = ImageViewMut::from_texels("image", &mut texels, size)?;
        self.results.tile(tile).fetch_dilation(self.reach, &mut image.with_origin(Origin::Bottom))?;
        Ok(Some(texels))
    }

    /// The gutters of images, one per page.
    fn gutters(&self, sizes: &[Option<[u32; 2]>]) -> vrtm::Result<Vec<Option<Gutter>>> {
        let gutter = |(page, size): (usize, &Option<[u32; 2]>)| {
            let Some(size) = *size else { return Ok(None) };
            Ok(self.places(page, size)?.map(|places| self.gutter(page, size, &places)))
        };
        sizes.iter().enumerate().map(gutter).collect()
    }

    fn gutter(&self, page: usize, size: [u32; 2], places: &[[f32; 4]]) -> Gutter {
        let corner = |udim: u32| [(udim - 1001) % 10, (udim - 1001) / 10].map(|k| k as f32);
        let (width, own) = (size[0] as usize, corner(self.udims[page]));
        // A place of its own means that the texel is in a chart.
        let is_own = |index: usize| {
            let centre = [index % width, index / width].map(|k| k as f32 + 0.5);
            (0..2).all(|c| {
                (places[index][c] - own[c] - centre[c] / size[c] as f32).abs() < 1e-4 / size[c] as f32 + 1e-6
            })
        };
        let known = |index: usize| places.get(index).is_some_and(|place| place[3] > 0.5);
        let inside: Vec<bool> = (0..places.len()).map(|index| known(index) && is_own(index)).collect();
        let mut texels = Vec::new();
        for index in (0..places.len()).filter(|&index| known(index) && !inside[index]) {
            let place = places[index];
            let tile = [place[0], place[1]].map(f32::floor);
            let Some(of) = self.udims.iter().position(|&udim| corner(udim) == tile) else { continue };
            // Of two neighbours, that whose content is near by: another one belongs to another seam.
            let change = |step: usize, c: usize| {
                let near = |other: Option<usize>, sign: f32| {
                    let other = other.filter(|&k| known(k) && !inside[k])?;
                    let way = [0, 1].map(|d| sign * (places[other][d] - place[d]));
                    (way[0].hypot(way[1]) * (size[0].min(size[1]) as f32) < 4.0).then_some(way)
                };
                let none = [0, 1].map(|d| if d == c { 1.0 / size[c] as f32 } else { 0.0 });
                near(Some(index + step), 1.0).or_else(|| near(index.checked_sub(step), -1.0)).unwrap_or(none)
            };
            let by = [change(1, 0), change(width, 1)];
            texels.push(Texel { index, page: of, uv: [place[0] - tile[0], place[1] - tile[1]], by });
        }
        Gutter { size, inside, texels }
    }

    /// The place of each texel's content in its own tile, as 16 bits each; 0, 0 for its own place. What the
    /// material is computed from.
    pub fn map(&self, page: usize) -> vrtm::Result<([u32; 2], Vec<[u16; 2]>)> {
        let size = [SIDE; 2];
        let mut map = vec![[0u16; 2]; (SIDE * SIDE) as usize];
        if let Some(places) = self.places(page, size)? {
            for texel in self.gutter(page, size, &places).texels {
                map[texel.index] = texel.uv.map(|x| (x.clamp(0.0, 1.0) * 65535.0).round().max(1.0) as u16);
            }
        }
        Ok((size, map))
    }

    /// Copies of the maps that go on beyond the seams.
    pub fn canvases(&self, canvases: &[Canvas]) -> Vec<Canvas> {
        let mut filled = canvases.to_vec();
        for (page, filled) in filled.iter_mut().enumerate() {
            self.fill(page, filled, canvases, |_| true);
        }
        filled
    }

    /// Follows a change of a map: returns the rectangles of the copies that changed with it.
    pub fn follow(
        &self,
        filled: &mut [Canvas],
        canvases: &[Canvas],
        page: usize,
        rect: Rect,
    ) -> Vec<(usize, Rect)> {
        let mut changed = vec![None; filled.len()];
        filled[page].paste(rect, &canvases[page].copy(rect));
        changed[page] = Some(rect);
        let size = canvases[page].size;
        // The rectangle in texels from v = 0 upward, with those beside it that a content is mixed from.
        let low = [rect.first[0] as f32, (size[1] - rect.first[1] - rect.size[1]) as f32];
        let near = |texel: &Texel| {
            let at = [0, 1].map(|c| texel.uv[c] * size[c] as f32 - low[c]);
            texel.page == page && (0..2).all(|c| at[c] > -2.0 && at[c] < rect.size[c] as f32 + 2.0)
        };
        for (other, changed) in changed.iter_mut().enumerate() {
            let whole = other == page;
            let of = self.fill(other, &mut filled[other], canvases, |texel| whole || near(texel));
            *changed = match (*changed, of) {
                (Some(a), Some(b)) => Some(a.with(b)),
                (a, b) => a.or(b),
            };
        }
        changed.into_iter().enumerate().filter_map(|(page, rect)| Some((page, rect?))).collect()
    }

    /// Fills the gutter of a page's map; returns the rectangle of what changed.
    fn fill(
        &self,
        page: usize,
        filled: &mut Canvas,
        canvases: &[Canvas],
        which: impl Fn(&Texel) -> bool,
    ) -> Option<Rect> {
        let gutter = self.of_maps[page].as_ref()?;
        let mut changed = None;
        for texel in gutter.texels.iter().filter(|texel| which(texel)) {
            let Some(from) = &self.of_maps[texel.page] else { continue };
            let source = &canvases[texel.page];
            let value = from.mean(texel.uv, |k| [f32::from(source.texels[upside_down(k, source.size)])])[0];
            let k = upside_down(texel.index, filled.size);
            if filled.texels[k] != value.round() as u16 {
                filled.texels[k] = value.round() as u16;
                changed = Some(Rect::around(changed, filled.place(k)));
            }
        }
        changed
    }

    /// Copies of textures that go on beyond the seams. Directions of a normal map are turned with the surface.
    pub fn textures(&self, textures: &Textures, are_normals: bool) -> vrtm::Result<Textures> {
        if textures.iter().all(Option::is_none) {
            return Ok(textures.clone());
        }
        let read: Vec<Option<RgbaImage>> = textures
            .iter()
            .map(|image| Some(pictures::at_most(LARGEST, (**image.as_ref()?).clone())))
            .collect();
        let sizes: Vec<_> =
            read.iter().map(|image| image.as_ref().map(|i| [i.width(), i.height()])).collect();
        let gutters = self.gutters(&sizes)?;
        let filled = |(image, gutter): (&Option<RgbaImage>, &Option<Gutter>)| {
            let mut image = image.clone()?;
            for texel in gutter.iter().flat_map(|gutter| &gutter.texels) {
                let (Some(from), Some(source)) = (&gutters[texel.page], &read[texel.page]) else {
                    continue;
                };
                let bytes: &[u8] = source;
                let mut mean = from.mean(texel.uv, |k| [0, 1, 2, 3].map(|c| f32::from(bytes[4 * k + c])));
                if are_normals {
                    let size = [image.width(), image.height()].map(|side| side as f32);
                    [mean[0], mean[1]] = turned([mean[0], mean[1]], texel.by, size);
                }
                let bytes: &mut [u8] = &mut image;
                bytes[4 * texel.index..4 * texel.index + 4].copy_from_slice(&mean.map(|x| x.round() as u8));
            }
            Some(image.into())
        };
        Ok(read.iter().zip(&gutters).map(filled).collect())
    }
}

/// A direction (bytes) in the plane of the content, in that of the gutter: by the rotation that is nearest to the
/// inverse of how the content's place changes.
fn turned(bytes: [f32; 2], by: [[f32; 2]; 2], size: [f32; 2]) -> [f32; 2] {
    let [x, y] = bytes.map(|byte| byte - 127.5);
    let [[a, c], [b, d]] = [0, 1].map(|k| by[k].map(|by| by * size[k]));
    // Transposed, a rotation or a mirror image is its inverse.
    let [u, v] = [a * x + c * y, b * x + d * y];
    let (before, after) = (x.hypot(y), u.hypot(v));
    if after > 0.0 { [u, v].map(|t| (127.5 + t * before / after).clamp(0.0, 255.0)) } else { bytes }
}

/// The index of a texel where rows run the other way.
fn upside_down(index: usize, [width, height]: [u32; 2]) -> usize {
    let (width, height) = (width as usize, height as usize);
    (height - 1 - index / width) * width + index % width
}

impl Gutter {
    /// The values around a UV, weighted as a sampler does, of texels in charts alone: beside these is whatever a
    /// painter left.
    fn mean<const N: usize>(&self, uv: [f32; 2], value: impl Fn(usize) -> [f32; N]) -> [f32; N] {
        let at = [0, 1].map(|c| uv[c] * self.size[c] as f32 - 0.5);
        let low = at.map(f32::floor);
        let place = |c: usize, k: f32| (low[c] + k).clamp(0.0, self.size[c] as f32 - 1.0) as usize;
        let (mut sum, mut all) = ([0.0; N], 0.0);
        for only_inside in [true, false] {
            for [x, y] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
                let k = place(1, y) * self.size[0] as usize + place(0, x);
                let share = (1.0 - (at[0] - low[0] - x).abs()) * (1.0 - (at[1] - low[1] - y).abs());
                if share > 0.0 && (self.inside[k] || !only_inside) {
                    let value = value(k);
                    sum = std::array::from_fn(|c| sum[c] + share * value[c]);
                    all += share;
                }
            }
            if all > 0.0 {
                break;
            }
        }
        sum.map(|x| x / all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On the mug's side, whose seam runs down the tile's left and right ends: what is painted on one end is copied
    /// beyond the other, and follows a stroke.
    #[test]
    fn maps_go_on_beyond_seams_and_follow_strokes() {
        let model = Model::scene("mug_to_jug");
        let empty = Canvas { size: [256; 2], texels: vec![0; 256 * 256], deep: false };
        let beyond = Beyond::new(&model, std::slice::from_ref(&empty), REACH).expect("beyond");
        // The side covers u from 0.02 to 0.98: a stripe at its right end, 3 to 6 texels from the border.
        let mut painted = empty.clone();
        for k in 0..256 * 256 {
            let [u, v] = painted.uv([k % 256, k / 256]);
            let texels = (0.98 - u) * 256.0;
            painted.texels[k as usize] =
                if (3.0..6.0).contains(&texels) && (0.6..0.9).contains(&v) { 65535 } else { 0 };
        }
        let [filled] = &beyond.canvases(std::slice::from_ref(&painted))[..] else { panic!("one page") };
        let value = |canvas: &Canvas, texels: f32, v: f32| {
            canvas.texels[canvas.index(canvas.texel([0.02 - texels / 256.0, v]))]
        };
        assert!(value(filled, 4.5, 0.75) > 60000, "{}", value(filled, 4.5, 0.75));
        assert_eq!((value(filled, 1.2, 0.75), value(filled, 4.5, 0.58)), (0, 0));
        assert_eq!(value(&painted, 4.5, 0.75), 0, "the map itself stays");
        // A stroke does what copying anew does.
        let mut followed = vec![empty.clone()];
        let rect = Rect { first: [240, 20], size: [12, 90] };
        let changed = beyond.follow(&mut followed, std::slice::from_ref(&painted), 0, rect);
        assert_eq!(&followed[0], filled);
        assert!(changed[0].1.first[0] < 5 && changed[0].1.size[0] > 240, "{changed:?}");
    }

    #[test]
    fn directions_turn_with_the_surface() {
        // The content's u runs up here, and its v to the left.
        let by = [[0.0, -0.01], [0.01, 0.0]];
        let [x, y] = turned([227.5, 127.5], by, [100.0, 100.0]);
        assert!((x - 127.5).abs() < 1e-3 && (y - 227.5).abs() < 1e-3, "{x} {y}");
    }
}
