//! The brush: the part of a surface under it, and the texels that are seen there.

use std::array::from_fn;
use std::collections::HashSet;

type Point = [f32; 3];
type Uv = [f32; 2];

/// Coverage by a brush, 0..1, at a distance from its middle in units of its radius; `softness`: the part of the radius
/// over which it fades out, 0..1.
#[must_use]
pub fn cover(distance: f32, softness: f32) -> f32 {
    let t = ((1.0 - distance) / softness.max(1e-3)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A surface of triangles to paint on, in any pose: `positions` has its vertices there.
pub struct Surface {
    vertices: Vec<[u32; 3]>,
    uvs: Vec<[Uv; 3]>,
    /// The texels around each triangle that are painted with it, as a texture is filtered over the borders of charts: 0
    /// within charts.
    margins: Vec<f32>,
    /// The triangles at each vertex: those of vertex v are `around[starts[v]..starts[v + 1]]`.
    around: Vec<u32>,
    starts: Vec<u32>,
}

/// Texels beside charts that belong to them.
pub const MARGIN: f32 = 2.0;

impl Surface {
    /// The vertices of each triangle, of `count`, and the UVs of its corners.
    #[must_use]
    pub fn new(vertices: Vec<[u32; 3]>, uvs: Vec<[Uv; 3]>, count: usize) -> Surface {
        let corners = || vertices.iter().enumerate().flat_map(|(k, of)| of.map(|v| (k, v as usize)));
        let mut starts = vec![0; count + 1];
        corners().for_each(|(_, v)| starts[v + 1] += 1);
        (0..count).for_each(|v| starts[v + 1] += starts[v]);
        let (mut next, mut around) = (starts.clone(), vec![0; 3 * vertices.len()]);
        for (k, v) in corners() {
            around[next[v] as usize] = k as u32;
            next[v] += 1;
        }
        let mut surface = Surface { vertices, uvs, margins: Vec::new(), around, starts };
        let is_inside = |k| [[0, 1], [1, 2], [2, 0]].into_iter().all(|edge| surface.is_within_chart(k, edge));
        surface.margins =
            (0..surface.vertices.len()).map(|k| if is_inside(k) { 0.0 } else { MARGIN }).collect();
        surface
    }

    /// True for an edge at which another triangle has the same UVs at both ends.
    fn is_within_chart(&self, triangle: usize, edge: [usize; 2]) -> bool {
        let ends = edge.map(|k| (self.vertices[triangle][k], self.uvs[triangle][k]));
        let is_at = |k: usize, end| self.vertices[k].into_iter().zip(self.uvs[k]).any(|corner| corner == end);
        let mut others = self.around(ends[0].0).filter(|&other| other != triangle);
        others.any(|other| ends.into_iter().all(|end| is_at(other, end)))
    }

    fn around(&self, vertex: u32) -> impl Iterator<Item = usize> {
        let [start, end] = [0, 1].map(|k| self.starts[vertex as usize + k] as usize);
        self.around[start..end].iter().map(|&k| k as usize)
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.vertices.len()
    }

    /// The places of a triangle's corners.
    #[must_use]
    pub fn corners(&self, triangle: usize, positions: &[Point]) -> [Point; 3] {
        self.vertices[triangle].map(|v| positions[v as usize])
    }

    /// The UV at a place on a triangle, by the weights of its corners.
    #[must_use]
    pub fn uv(&self, triangle: usize, weights: [f32; 3]) -> Uv {
        mixed(self.uvs[triangle], weights)
    }

    /// The triangle that a ray hits first, and the weights of its corners there.
    #[must_use]
    pub fn hit(&self, positions: &[Point], (from, way): (Point, Point)) -> Option<(usize, [f32; 3])> {
        let mut best = None;
        let mut nearest = f32::INFINITY;
        for triangle in 0..self.vertices.len() {
            let [a, b, c] = self.corners(triangle, positions);
            let [e, f, to] = [minus(b, a), minus(c, a), minus(from, a)];
            let p = cross(way, f);
            let det = dot(e, p);
            let v = dot(to, p) / det;
            if !(0.0..=1.0).contains(&v) {
                continue;
            }
            let q = cross(to, e);
            let [w, along] = [dot(way, q) / det, dot(f, q) / det];
            if w >= 0.0 && v + w <= 1.0 && along > 0.0 && along < nearest {
                nearest = along;
                best = Some((triangle, [1.0 - v - w, v, w]));
            }
        }
        best
    }

    /// The triangles within `radius` of a point of triangle `first` that hang together with it: another part of the
    /// surface that is as near, such as the other side of a thin wall, does not belong to them.
    #[must_use]
    pub fn disc(&self, positions: &[Point], first: usize, (centre, radius): (Point, f32)) -> Vec<usize> {
        let (mut seen, mut waiting, mut found) = (HashSet::from([first]), vec![first], Vec::new());
        while let Some(triangle) = waiting.pop() {
            let corners = self.corners(triangle, positions);
            if distance(mixed(corners, closest(centre, corners)), centre) <= radius {
                found.push(triangle);
                let near = self.vertices[triangle].into_iter().flat_map(|v| self.around(v));
                waiting.extend(near.filter(|&next| seen.insert(next)));
            }
        }
        found
    }

    /// Tells the texels of a map that are seen on a triangle within `radius` of a point, each with its distance in
    /// units of the radius, some more than once. The map, of `size` texels, is looked up through a redirection: `delta`
    /// tells that of a column and a row of `grid` texels. Both have their first row at v = 1.
    pub fn fill(
        &self,
        (triangle, positions): (usize, &[Point]),
        (centre, radius): (Point, f32),
        size: [usize; 2],
        (grid, delta): ([usize; 2], impl Fn(usize, usize) -> Uv),
        mut found: impl FnMut(usize, f32),
    ) {
        let (corners, uvs) = (self.corners(triangle, positions), self.uvs[triangle]);
        // Rounding leaves no gaps between triangles.
        let margin = self.margins[triangle].max(0.01);
        let Some(own) = Area::new(uvs.map(|uv| texel(uv, size)), margin) else { return };
        let [low, high] = reach(centre, radius, corners, uvs.map(|uv| texel(uv, grid)));
        let beside: [f32; 2] = from_fn(|c| margin * grid[c] as f32 / size[c] as f32);
        // From one texel before the first, since cells lie between the centres of texels.
        let end = |c: usize, at: f32| (at.floor().clamp(-1.0, grid[c] as f32 - 1.0)) as isize;
        let [columns, rows] = [0, 1].map(|c| end(c, low[c] - beside[c])..=end(c, high[c] + beside[c]));
        // A point of the redirection's grid, on the surface and in the map.
        let node = |x: isize, y: isize| {
            let [i, j] = [(x, grid[0]), (y, grid[1])].map(|(k, n)| k.clamp(0, n as isize - 1) as usize);
            let on = [(x as f32 + 0.5) / grid[0] as f32, 1.0 - (y as f32 + 0.5) / grid[1] as f32];
            let delta = delta(i, j);
            (texel(on, size), texel([on[0] + delta[0], on[1] + delta[1]], size))
        };
        for y in rows {
            for x in columns.clone() {
                let [a, b, c, d] = [node(x, y), node(x + 1, y), node(x, y + 1), node(x + 1, y + 1)];
                for half in [[a, b, d], [a, d, c]] {
                    // What lies on an edge belongs to both sides.
                    let Some(seen) = Area::new(half.map(|(_, seen)| seen), 1e-3) else { continue };
                    seen.raster(size, |texel, w| {
                        let Some(w) = own.weights(mixed(half.map(|(on, _)| on), w)) else { return };
                        let away = distance(mixed(corners, w), centre) / radius;
                        if away < 1.0 {
                            found(texel, away);
                        }
                    });
                }
            }
        }
    }

    /// Tells the texels of a map of `size` on a triangle, or up to `margin` texels beside it.
    pub fn texels(&self, triangle: usize, margin: f32, size: [usize; 2], mut found: impl FnMut(usize)) {
        if let Some(area) = Area::new(self.uvs[triangle].map(|uv| texel(uv, size)), margin) {
            area.raster(size, |texel, _| found(texel));
        }
    }
}

/// The place of a UV in a map, in texels from the centre of the first.
fn texel(uv: Uv, size: [usize; 2]) -> Uv {
    [uv[0] * size[0] as f32 - 0.5, (1.0 - uv[1]) * size[1] as f32 - 0.5]
}

/// A triangle in a map with a margin around it, in texels.
struct Area {
    corners: [Uv; 3],
    double_area: f32,
    /// The least weight of each corner in the margin.
    least: [f32; 3],
    /// The least and the greatest place in the margin.
    ends: [Uv; 2],
}

impl Area {
    fn new(corners: [Uv; 3], margin: f32) -> Option<Area> {
        let double_area = double_area(corners);
        // Heights of the triangle over its sides tell how much weight lies in the margin.
        let side = |[a, b]: [Uv; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
        let sides: [f32; 3] = from_fn(|k| side([corners[(k + 1) % 3], corners[(k + 2) % 3]]));
        let least = sides.map(|side| -margin * side / double_area.abs());
        let [low, high] = ends(corners);
        let ends = [low.map(|x| x - margin), high.map(|x| x + margin)];
        (double_area != 0.0).then_some(Area { corners, double_area, least, ends })
    }

    /// The weights of the corners at a place, if it lies in the triangle or its margin.
    fn weights(&self, at: Uv) -> Option<[f32; 3]> {
        let [a, b, c] = self.corners;
        let w = [[b, c, at], [c, a, at], [a, b, at]].map(|side| double_area(side) / self.double_area);
        let [low, high] = self.ends;
        let is_near = (0..2).all(|c| at[c] >= low[c] && at[c] <= high[c]);
        (is_near && (0..3).all(|k| w[k] >= self.least[k])).then_some(w)
    }

    /// Tells the texels whose centres lie here, with the weights of the corners.
    fn raster(&self, size: [usize; 2], mut found: impl FnMut(usize, [f32; 3])) {
        let [low, high] = self.ends;
        if (0..2).any(|c| high[c] < 0.0 || low[c] > size[c] as f32 - 1.0) {
            return;
        }
        let [columns, rows] = [0, 1]
            .map(|c| low[c].ceil().max(0.0) as usize..=high[c].floor().min(size[c] as f32 - 1.0) as usize);
        for y in rows {
            for x in columns.clone() {
                if let Some(w) = self.weights([x as f32, y as f32]) {
                    found(y * size[0] + x, w);
                }
            }
        }
    }
}

/// The least and the greatest place on a triangle that may be within the radius of a point.
fn reach(centre: Point, radius: f32, corners: [Point; 3], places: [Uv; 3]) -> [Uv; 2] {
    let w = closest(centre, corners);
    let [e, f] = [1, 2].map(|k| minus(corners[k], corners[0]));
    let (ee, ef, ff) = (dot(e, e), dot(e, f), dot(f, f));
    let [first, last] = ends(places);
    let found = [0, 1].map(|c| {
        let values = places.map(|place| place[c]);
        let (du, dv) = (values[1] - values[0], values[2] - values[0]);
        // The place changes by so much along the surface at most; as far as twice the radius, since the nearest point
        // lies within it.
        let slope = (du * du * ff - 2.0 * du * dv * ef + dv * dv * ee) / (ee * ff - ef * ef);
        let reach = 2.0 * radius * slope.max(0.0).sqrt();
        let reach = if reach.is_finite() { reach } else { f32::MAX };
        let middle: f32 = (0..3).map(|k| w[k] * values[k]).sum();
        [first[c].max(middle - reach), last[c].min(middle + reach)]
    });
    [0, 1].map(|side| found.map(|end| end[side]))
}

/// The least and the greatest place of a triangle.
fn ends(corners: [Uv; 3]) -> [Uv; 2] {
    [f32::min, f32::max]
        .map(|most| from_fn(|c| corners.iter().fold(corners[0][c], |end, at| most(end, at[c]))))
}

fn double_area([a, b, c]: [Uv; 3]) -> f32 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The weights of the corners of a triangle at its point that is closest to another point.
#[must_use]
pub fn closest(p: Point, [a, b, c]: [Point; 3]) -> [f32; 3] {
    let n = cross(minus(b, a), minus(c, a));
    let area = dot(n, n);
    if area > 0.0 {
        let side = |from: Point, to: Point| dot(n, cross(minus(to, from), minus(p, from))) / area;
        let w = [side(b, c), side(c, a), side(a, b)];
        if w.iter().all(|&w| w >= 0.0) {
            return w;
        }
    }
    // Otherwise it lies on an edge.
    let on = |from: Point, to: Point, weights: fn(f32) -> [f32; 3]| {
        let way = minus(to, from);
        weights((dot(minus(p, from), way) / dot(way, way).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0))
    };
    let edges =
        [on(a, b, |t| [1.0 - t, t, 0.0]), on(b, c, |t| [0.0, 1.0 - t, t]), on(c, a, |t| [t, 0.0, 1.0 - t])];
    let away = |w: &[f32; 3]| distance(mixed([a, b, c], *w), p);
    edges.into_iter().min_by(|one, other| away(one).total_cmp(&away(other))).unwrap_or([1.0, 0.0, 0.0])
}

/// The mean of three corners' values, by their weights.
#[must_use]
pub fn mixed<const N: usize>(of: [[f32; N]; 3], w: [f32; 3]) -> [f32; N] {
    from_fn(|c| (0..3).map(|k| w[k] * of[k][c]).sum())
}

fn minus(a: Point, b: Point) -> Point {
    from_fn(|c| a[c] - b[c])
}

fn dot(a: Point, b: Point) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn distance(a: Point, b: Point) -> f32 {
    let way = minus(a, b);
    dot(way, way).sqrt()
}
