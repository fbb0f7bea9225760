//! Which triangle lies at each texel of a tile.

use crate::mesh::Triangle;

/// No triangle.
const NONE: u32 = u32::MAX;
/// Texels around charts that belong to the triangle beside them: a texture is filtered over its borders.
const MARGIN: usize = 2;

/// The triangle at each texel, rows from v = 0 upward.
pub struct Ids {
    size: [u32; 2],
    ids: Vec<u32>,
}

impl Ids {
    /// `triangles` are those of the tile, with their indices among all.
    pub fn new<'a>(triangles: impl Iterator<Item = (usize, &'a Triangle)>, size: [u32; 2]) -> Ids {
        let mut all = Ids { size, ids: vec![NONE; (size[0] * size[1]) as usize] };
        for (index, triangle) in triangles {
            all.fill(
                index as u32,
                &triangle.uvs.map(|uv| [0, 1].map(|c| uv[c] as f32 * size[c] as f32 - 0.5)),
            );
        }
        for _ in 0..MARGIN {
            all.grow();
        }
        all
    }

    /// The triangle at a UV.
    pub fn at(&self, uv: [f32; 2]) -> Option<usize> {
        let place = |c: usize| ((uv[c] * self.size[c] as f32).max(0.0) as u32).min(self.size[c] - 1);
        let id = self.ids[(place(1) * self.size[0] + place(0)) as usize];
        (id != NONE).then_some(id as usize)
    }

    /// Marks the texels whose centres lie in a triangle; its corners in texels from the first centre.
    fn fill(&mut self, id: u32, corners: &[[f32; 2]; 3]) {
        let [a, b, c] = *corners;
        let end = |c: usize, value: f32| value.clamp(0.0, self.size[c] as f32 - 1.0) as u32;
        let low = [0, 1].map(|k| end(k, a[k].min(b[k]).min(c[k]).ceil()));
        let high = [0, 1].map(|k| end(k, a[k].max(b[k]).max(c[k]).floor()));
        for y in low[1]..=high[1] {
            for x in low[0]..=high[0] {
                let at = [x as f32, y as f32];
                let side = |p: [f32; 2], q: [f32; 2]| {
                    (q[0] - p[0]) * (at[1] - p[1]) - (q[1] - p[1]) * (at[0] - p[0])
                };
                let w = [side(b, c), side(c, a), side(a, b)];
                if w.iter().all(|&w| w >= 0.0) || w.iter().all(|&w| w <= 0.0) {
                    self.ids[(y * self.size[0] + x) as usize] = id;
                }
            }
        }
    }

    /// Gives texels beside charts to a neighbour's triangle.
    fn grow(&mut self) {
        let [width, height] = self.size.map(|side| side as usize);
        let old = self.ids.clone();
        for (k, id) in self.ids.iter_mut().enumerate().filter(|(_, id)| **id == NONE) {
            let (x, y) = (k % width, k / width);
            let near = [
                (x > 0).then(|| old[k - 1]),
                (x + 1 < width).then(|| old[k + 1]),
                (y > 0).then(|| old[k - width]),
                (y + 1 < height).then(|| old[k + width]),
            ];
            *id = near.into_iter().flatten().find(|&id| id != NONE).unwrap_or(NONE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_belong_to_the_triangle_over_them_and_a_margin() {
        let uvs = [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75]];
        let triangle = Triangle { vertices: [0, 1, 2], uvs, corners: [0, 1, 2], udim: 1001 };
        let ids = Ids::new([(7, &triangle)].into_iter(), [32, 32]);
        assert_eq!(ids.at([0.3, 0.3]), Some(7));
        assert_eq!(ids.at([0.25 - 1.5 / 32.0, 0.4]), Some(7), "the margin");
        assert_eq!(ids.at([0.1, 0.1]), None);
        assert_eq!(ids.at([0.7, 0.7]), None);
    }
}
