//! Finds the chart of a node.

use std::collections::HashMap;

use vrtm_testkit::Model;

/// A triangle of a face: indices into the corners of the mesh.
type Triangle = [usize; 3];

/// The index of the chart of the triangle nearest to a UV, in the order of first faces, and the number of charts in the
/// tile.
pub fn find(model: &Model, udim: u32, uv: [f64; 2]) -> Option<(usize, usize)> {
    let at = |corner: usize| model.uvs[model.uv_indices[corner] as usize];
    let mut triangles: Vec<Triangle> = Vec::new();
    for face in model.faces() {
        let count = face.len() as f32;
        let middle = [0, 1].map(|c| (face.clone().map(|k| at(k)[c]).sum::<f32>() / count).floor() as u32);
        if 1001 + middle[0] + 10 * middle[1] == udim {
            triangles.extend((face.start + 1..face.end - 1).map(|k| [face.start, k, k + 1]));
        }
    }
    let charts = charts(&triangles, |corner| at(corner).map(f32::to_bits));
    let far = |t: &Triangle| distance(t.map(|corner| at(corner).map(f64::from)), uv);
    let nearest = (0..triangles.len()).min_by(|&a, &b| far(&triangles[a]).total_cmp(&far(&triangles[b])))?;
    Some((charts[nearest], charts.iter().max()? + 1))
}

/// The chart of each triangle: triangles that share UVs, by value, are connected.
fn charts(triangles: &[Triangle], key: impl Fn(usize) -> [u32; 2]) -> Vec<usize> {
    let mut chart: Vec<usize> = (0..triangles.len()).collect();
    // The lowest index among all triangles around a UV spreads until nothing changes.
    loop {
        let mut lowest: HashMap<[u32; 2], usize> = HashMap::new();
        for (t, triangle) in triangles.iter().enumerate() {
            for &corner in triangle {
                lowest.entry(key(corner)).and_modify(|low| *low = chart[t].min(*low)).or_insert(chart[t]);
            }
        }
        let mut same = true;
        for (t, triangle) in triangles.iter().enumerate() {
            let low = triangle.iter().map(|&corner| lowest[&key(corner)]).min().unwrap_or(chart[t]);
            same &= low == chart[t];
            chart[t] = low;
        }
        if same {
            break;
        }
    }
    let mut firsts = chart.clone();
    firsts.sort_unstable();
    firsts.dedup();
    chart.iter().map(|first| firsts.partition_point(|f| f < first)).collect()
}

/// Distance of a point from a triangle in the plane.
fn distance(corners: [[f64; 2]; 3], p: [f64; 2]) -> f64 {
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    let minus = |a: [f64; 2], b: [f64; 2]| [a[0] - b[0], a[1] - b[1]];
    let sides = [0, 1, 2].map(|k| (corners[k], minus(corners[(k + 1) % 3], corners[k])));
    let turns = sides.map(|(from, along)| cross(along, minus(p, from)));
    if turns.iter().all(|&x| x >= 0.0) || turns.iter().all(|&x| x <= 0.0) {
        return 0.0;
    }
    let to_side = |(from, along): ([f64; 2], [f64; 2])| {
        let d = minus(p, from);
        let square = along[0] * along[0] + along[1] * along[1];
        let s = ((d[0] * along[0] + d[1] * along[1]) / square.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (d[0] - s * along[0]).hypot(d[1] - s * along[1])
    };
    sides.into_iter().map(to_side).fold(f64::INFINITY, f64::min)
}
