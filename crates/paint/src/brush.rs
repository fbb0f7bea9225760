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

/// The triangle that a ray hits first, and the weights of its corners there. `corners` tells those of each triangle.
pub fn hit(
    (from, way): (Point, Point),
    triangles: usize,
    corners: impl Fn(usize) -> [Point; 3],
) -> Option<(usize, [f32; 3])> {
    let mut best = None;
    let mut nearest = f32::INFINITY;
    for triangle in 0..triangles {
        let [a, b, c] = corners(triangle);
        let [e, f, to] = [minus(b, a), minus(c, a), minus(from, a)];
        let (p, q) = (cross(way, f), cross(to, e));
        let det = dot(e, p);
        let [v, w, along] = [dot(to, p) / det, dot(way, q) / det, dot(f, q) / det];
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 && along > 0.0 && along < nearest {
            nearest = along;
            best = Some((triangle, [1.0 - v - w, v, w]));
        }
    }
    best
}

/// The triangles within `radius` of a point of triangle `first` that hang together with it: another part of the surface
/// that is as near, such as the other side of a thin wall, does not belong to them. `vertices` has those of a triangle,
/// `around` the triangles at a vertex.
pub fn disc<'a>(
    first: usize,
    (centre, radius): (Point, f32),
    positions: &[Point],
    vertices: impl Fn(usize) -> [u32; 3],
    around: impl Fn(u32) -> &'a [u32],
) -> Vec<usize> {
    let (mut seen, mut waiting, mut found) = (HashSet::from([first]), vec![first], Vec::new());
    while let Some(triangle) = waiting.pop() {
        let corners = vertices(triangle).map(|v| positions[v as usize]);
        if distance(mixed(corners, closest(centre, corners)), centre) <= radius {
            found.push(triangle);
            let near = vertices(triangle).into_iter().flat_map(&around).map(|&next| next as usize);
            waiting.extend(near.filter(|&next| seen.insert(next)));
        }
    }
    found
}

/// Tells the texels of a map that are seen on a triangle within `radius` of a point, each with its distance in units of
/// the radius, some more than once. The map, of `size` texels, is looked up through a redirection: `delta` tells that
/// of a column and a row of `grid` texels. Both have their first row at v = 1. `margin`: texels around the triangle
/// that are its own, too, as beside a chart, whose texture is filtered over its border.
pub fn fill(
    (corners, uvs, margin): ([Point; 3], [Uv; 3], f32),
    (centre, radius): (Point, f32),
    size: [usize; 2],
    (grid, delta): ([usize; 2], impl Fn(usize, usize) -> Uv),
    mut found: impl FnMut(usize, f32),
) {
    let texels =
        |uv: Uv, size: [usize; 2]| [uv[0] * size[0] as f32 - 0.5, (1.0 - uv[1]) * size[1] as f32 - 0.5];
    // Rounding leaves no gaps between triangles.
    let margin = margin.max(0.01);
    // Heights of the triangle over its sides, in texels, tell how much weight lies in the margin.
    let own = uvs.map(|uv| texels(uv, size));
    let area = double_area(own);
    if area == 0.0 {
        return;
    }
    let side = |[a, b]: [Uv; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let least: [f32; 3] = from_fn(|k| -margin * side([own[(k + 1) % 3], own[(k + 2) % 3]]) / area.abs());
    let [start, stop] = ends(own);
    let is_near = |on: Uv| (0..2).all(|c| on[c] >= start[c] - margin && on[c] <= stop[c] + margin);
    let [low, high] = reach(centre, radius, corners, uvs.map(|uv| texels(uv, grid)));
    let beside: [f32; 2] = from_fn(|c| margin * grid[c] as f32 / size[c] as f32);
    // From one texel before the first, since cells lie between the centres of texels.
    let end = |c: usize, at: f32| (at.floor().clamp(-1.0, grid[c] as f32 - 1.0)) as isize;
    let [columns, rows] = [0, 1].map(|c| end(c, low[c] - beside[c])..=end(c, high[c] + beside[c]));
    // A point of the redirection's grid, on the surface and in the map.
    let node = |x: isize, y: isize| {
        let [i, j] = [(x, grid[0]), (y, grid[1])].map(|(k, n)| k.clamp(0, n as isize - 1) as usize);
        let on = [(x as f32 + 0.5) / grid[0] as f32, 1.0 - (y as f32 + 0.5) / grid[1] as f32];
        let delta = delta(i, j);
        (texels(on, size), texels([on[0] + delta[0], on[1] + delta[1]], size))
    };
    for y in rows {
        for x in columns.clone() {
            let [a, b, c, d] = [node(x, y), node(x + 1, y), node(x, y + 1), node(x + 1, y + 1)];
            for half in [[a, b, d], [a, d, c]] {
                raster(half.map(|(_, seen)| seen), size, |texel, w| {
                    let on = mixed(half.map(|(on, _)| on), w);
                    let w = weights(own, area, on);
                    let away = distance(mixed(corners, w), centre) / radius;
                    if away < 1.0 && is_near(on) && (0..3).all(|k| w[k] >= least[k]) {
                        found(texel, away);
                    }
                });
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

/// Tells the texels whose centres lie in a triangle, with the weights of its corners.
fn raster(corners: [Uv; 3], size: [usize; 2], mut found: impl FnMut(usize, [f32; 3])) {
    let area = double_area(corners);
    let [low, high] = ends(corners);
    if area == 0.0 || (0..2).any(|c| high[c] < 0.0 || low[c] > size[c] as f32 - 1.0) {
        return;
    }
    let [columns, rows] =
        [0, 1].map(|c| low[c].ceil().max(0.0) as usize..=high[c].floor().min(size[c] as f32 - 1.0) as usize);
    for y in rows {
        for x in columns.clone() {
            let w = weights(corners, area, [x as f32, y as f32]);
            // What lies on an edge belongs to both sides.
            if w.iter().all(|&w| w >= -1e-4) {
                found(y * size[0] + x, w);
            }
        }
    }
}

fn double_area([a, b, c]: [Uv; 3]) -> f32 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The weights of a triangle's corners at a place.
fn weights([a, b, c]: [Uv; 3], area: f32, at: Uv) -> [f32; 3] {
    [[b, c, at], [c, a, at], [a, b, at]].map(|side| double_area(side) / area)
}

/// The weights of the corners of a triangle at its point that is closest to another point.
fn closest(p: Point, [a, b, c]: [Point; 3]) -> [f32; 3] {
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
