//! Random models of islands that lie over one another in the UV plane. Each island is a sheet of squares, whose UVs are
//! a turned, mirrored and scaled square: that is all that the checks know of it, and it shares no code with the
//! library.

use vrtm::{Asset, Device, MeshSource, Strided, TileSettings, UvSource};

use vrtm_testkit::random::Random;
use vrtm_testkit::{quads, view};

/// Squares along a side of an island.
pub const SIDE: usize = 6;
/// Cells along a side of the grid.
pub const GRID: u32 = 64;
/// Texels along a side of the rigidity map.
const MAP: u32 = 64;
/// Charts that overlap by less than this, in UV, are neighbours (the library's documented value).
pub const DEPTH: f64 = 1.0 / 4096.0;

/// An island: the UV of its corner (0, 0), and its sides.
#[derive(Clone, Copy, Debug)]
pub struct Island {
    pub origin: [f64; 2],
    pub sides: [[f64; 2]; 2],
}

impl Island {
    fn random(random: &mut Random) -> Island {
        let (size, angle) = (random.between(0.1, 0.5), random.between(0.0, std::f64::consts::TAU));
        let (s, c) = angle.sin_cos();
        let mirror = if random.below(2) == 0 { 1.0 } else { -1.0 };
        let sides = [[size * c, size * s], [-size * s * mirror, size * c * mirror]];
        let span = |axis: usize| {
            let ends = [0.0, sides[0][axis], sides[1][axis], sides[0][axis] + sides[1][axis]];
            (ends.iter().copied().fold(0.0, f64::min), ends.iter().copied().fold(0.0, f64::max))
        };
        let origin = [0, 1].map(|axis| {
            let (low, high) = span(axis);
            random.between(0.01 - low, 0.99 - high)
        });
        Island { origin, sides }
    }

    /// The UV of a place in the unit square.
    pub fn uv(&self, [s, t]: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| self.origin[k] + s * self.sides[0][k] + t * self.sides[1][k])
    }

    /// Depth of a UV inside of the island; negative outside.
    pub fn depth(&self, uv: [f64; 2]) -> f64 {
        let [[a, b], [c, d]] = self.sides;
        let (x, y) = (uv[0] - self.origin[0], uv[1] - self.origin[1]);
        let det = a * d - b * c;
        let (s, t) = ((x * d - y * c) / det, (y * a - x * b) / det);
        let side = a.hypot(b);
        [s, 1.0 - s, t, 1.0 - t].into_iter().fold(f64::INFINITY, f64::min) * side
    }

    /// Depth of the deepest common point; negative if there is none.
    pub fn shared_depth(&self, other: &Island) -> f64 {
        // The least of several linear functions has no maxima but the greatest one.
        let at = |u: f64, v: f64| self.depth([u, v]).min(other.depth([u, v]));
        greatest(|u| greatest(|v| at(u, v)))
    }
}

/// The maximum over 0..1 of a function that has one.
fn greatest(f: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..40 {
        let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
        if f(a) < f(b) { low = a } else { high = b }
    }
    f(0.5 * (low + high))
}

/// A model of islands, with one pose.
#[derive(Clone)]
pub struct Stack {
    pub islands: Vec<Island>,
    pub rest: Vec<[f32; 3]>,
    pub pose: Vec<[f32; 3]>,
    pub indices: Vec<u32>,
    pub uvs: Vec<[f32; 2]>,
    /// The UV of each corner; `None` = the one of its vertex's number.
    pub uv_indices: Option<Vec<u32>>,
    pub rigidity: Vec<u8>,
}

impl Stack {
    pub fn random(seed: u64) -> Stack {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let count = 2 + random.below(6);
        let mut islands: Vec<Island> = (0..count).map(|_| Island::random(&mut random)).collect();
        // Some lie exactly over others, as mirrored halves and copies do.
        for k in 1..count {
            if random.below(3) == 0 {
                islands[k] = islands[random.below(k)];
                if random.below(2) == 0 {
                    let Island { origin, sides: [a, b] } = islands[k];
                    islands[k] = Island { origin, sides: [b, a] };
                }
            }
        }
        Stack::of(islands, &mut random)
    }

    pub fn of(islands: Vec<Island>, random: &mut Random) -> Stack {
        let (mut rest, mut pose, mut uvs, mut indices) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (k, island) in islands.iter().enumerate() {
            let first = rest.len();
            let waves: [f64; 6] = std::array::from_fn(|_| random.between(-1.0, 1.0));
            for j in 0..=SIDE {
                for i in 0..=SIDE {
                    let [s, t] = [i, j].map(|n| n as f64 / SIDE as f64);
                    let size = island.sides[0][0].hypot(island.sides[0][1]);
                    let plane = k as f64;
                    rest.push([size * s, size * t, plane].map(|x| x as f32));
                    let (x, y) = (
                        s + 0.12 * (3.0 * s + 2.0 * waves[0]).sin() * waves[1] * 2.0 + 0.3 * waves[2] * s * t,
                        t + 0.12 * (4.0 * t + 2.0 * waves[3]).cos() * waves[4] * 2.0 + 0.3 * waves[5] * s * s,
                    );
                    pose.push([size * x, size * y, plane + 0.1 * s * t].map(|x| x as f32));
                    uvs.push(island.uv([s, t]).map(|x| x as f32));
                }
            }
            indices.extend(quads([SIDE; 2], first));
        }
        let size = MAP as usize;
        let mut rigidity = vec![0; size * size];
        for _ in 0..8 {
            let [u, v] = [0, 1].map(|_| random.between(0.0, 1.0));
            let radius = random.between(0.03, 0.09);
            for (n, texel) in rigidity.iter_mut().enumerate() {
                let [x, y] = [n % size, n / size].map(|k| (k as f64 + 0.5) / f64::from(MAP));
                if (x - u).hypot(y - v) < radius {
                    *texel = 255;
                }
            }
        }
        Stack { islands, rest, pose, indices, uvs, uv_indices: None, rigidity }
    }

    /// The asset with up to `max_layers` layers, of the faces of one island or of all.
    pub fn asset(&self, device: &Device, max_layers: u32, island: Option<usize>) -> Asset {
        let [u, v] = [0, 1].map(|k| self.uvs.iter().map(|uv| uv[k]).collect::<Vec<f32>>());
        let uvs = UvSource {
            u: Strided::from_slice(&u),
            v: Some(Strided::from_slice(&v)),
            indices: Some(self.uv_indices.as_ref().unwrap_or(&self.indices)),
        };
        let counts = vec![4; self.indices.len() / 4];
        let chosen: Option<Vec<u32>> = island.map(|k| self.faces(k).map(|face| face as u32).collect());
        let source = MeshSource {
            positions: Strided::from_slice(&self.rest),
            face_counts: Some(&counts),
            indices: &self.indices,
            uvs,
            textured_faces: chosen.as_deref(),
            max_layers,
            ..MeshSource::default()
        };
        let mut asset = Asset::new(device, &source).unwrap();
        let settings = TileSettings { grid: [Some(GRID); 2], ..TileSettings::default() };
        for tile in 0..asset.tile_count() {
            asset.tile_mut(tile).set_rigidity(Some(view(&self.rigidity, MAP, MAP))).unwrap();
            asset.tile_mut(tile).set_settings(&settings).unwrap();
        }
        asset
    }

    pub fn positions(&self) -> Strided<'_> {
        Strided::from_slice(&self.pose)
    }

    /// The faces of an island.
    pub fn faces(&self, island: usize) -> std::ops::Range<usize> {
        island * SIDE * SIDE..(island + 1) * SIDE * SIDE
    }
}
