//! Collars of sheets that are cut into charts: the surface beyond a seam lies where the uncut sheet has it.

mod extended;

use glam::{DMat2, DVec2};

use vrtm_beyond::{CollarTriangle, Surface, collar};
use vrtm_core::mesh::{Mesh, MeshSource, UvSource};
use vrtm_core::settings::Beyond;
use vrtm_core::view::Strided;

/// A sheet of `n` by `n` quads whose columns from `cut` on lie elsewhere in the UV plane.
struct Sheet {
    n: usize,
    cut: usize,
    /// Position of the sheet's point (i, j) on the surface.
    point: fn(f64, f64) -> [f32; 3],
    /// The second chart's UVs, from those that the uncut sheet would have there.
    turn: DMat2,
    shift: DVec2,
    /// True if the last column's right border is the first one's left border on the surface.
    closed: bool,
}

impl Sheet {
    /// The UV of a point of the uncut sheet.
    fn uv(&self, i: usize, j: usize) -> DVec2 {
        DVec2::new(0.1, 0.1) + 0.5 * DVec2::new(i as f64, j as f64) / self.n as f64
    }

    fn mesh(&self) -> Mesh {
        let n = self.n;
        let columns = if self.closed { n } else { n + 1 };
        let vertex = |i: usize, j: usize| (j * columns + i % columns) as u32;
        let mut rest = vec![[0.0; 3]; columns * (n + 1)];
        let (mut indices, mut uvs) = (Vec::new(), Vec::new());
        for j in 0..=n {
            for i in 0..columns {
                rest[vertex(i, j) as usize] = (self.point)(i as f64 / n as f64, j as f64 / n as f64);
            }
        }
        for (i, j) in (0..n * n).map(|q| (q % n, q / n)) {
            let mut corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
            // Faces of a mesh need not all turn the same way.
            if (i + 2 * j) % 3 == 0 {
                corners.reverse();
            }
            for (k, l) in corners {
                indices.push(vertex(k, l));
                let uv = self.uv(k, l);
                let uv = if i >= self.cut { self.turn * uv + self.shift } else { uv };
                uvs.push(uv.to_array().map(|x| x as f32));
            }
        }
        let corners: Vec<u32> = (0..indices.len() as u32).collect();
        let counts = vec![4; n * n];
        Mesh::new(&MeshSource {
            positions: Strided::from_slice(&rest),
            face_counts: Some(&counts),
            indices: &indices,
            uvs: UvSource { u: Strided::from_slice(&uvs), v: None, indices: Some(&corners) },
            ..MeshSource::default()
        })
        .unwrap()
    }

    fn uncut(&self, uv: DVec2) -> DVec2 {
        self.turn.inverse() * (uv - self.shift)
    }
}

fn flat(x: f64, y: f64) -> [f32; 3] {
    [x as f32, y as f32, 0.0]
}

fn bent(x: f64, y: f64) -> [f32; 3] {
    [(2.0 * x).sin() as f32 / 2.0, y as f32, (2.0 * x).cos() as f32 / 2.0]
}

fn of_tile(mesh: &Mesh, tile: usize, reach: f64) -> Vec<vrtm_core::allocation::Vec<CollarTriangle>> {
    let surface = Surface::new(mesh, tile, &Beyond { seams: true, open_borders: false, reach });
    let charts = 0..mesh.tiles[tile].charts.len();
    charts.map(|chart| collar(&surface, chart, reach, &|| ()).triangles).collect()
}

/// UVs of the corners on the surface, in the plane of all tiles.
fn source(mesh: &Mesh, triangle: &CollarTriangle) -> [DVec2; 3] {
    triangle.source.uv.map(|uv| uv + mesh.tiles[triangle.source.tile as usize].origin())
}

#[test]
fn a_cut_sheet_goes_on_as_if_it_were_whole() {
    let (sin, cos) = 0.7f64.sin_cos();
    let turned = DMat2::from_cols_array(&[cos, sin, -sin, cos]);
    let turns = [
        (DMat2::IDENTITY, DVec2::new(0.25, 0.0)),
        (turned, DVec2::new(0.45, 0.0)),
        // One and a half times as large, mirrored, and in another tile.
        (DMat2::from_cols_array(&[0.0, 1.5, 1.5, 0.0]), DVec2::new(2.0, 3.0)),
    ];
    // The chords of the bent sheet are shorter than its arcs by 4e-4.
    for (n, point, tolerance) in
        [(20, flat as fn(f64, f64) -> [f32; 3], 1e-6), (4, flat, 1e-6), (20, bent, 5e-5)]
    {
        for (turn, shift) in turns {
            let sheet = Sheet { n, cut: n / 2, point, turn, shift, closed: false };
            let mesh = sheet.mesh();
            assert_eq!(mesh.info.charts, 2);
            let reach = 0.06;
            let collar = &of_tile(&mesh, 0, reach)[0];
            let (mut area, mut farthest) = (0.0, 0.0f64);
            for triangle in collar {
                for (uv, source) in triangle.uv.into_iter().zip(source(&mesh, triangle)) {
                    let expected = sheet.uncut(source);
                    assert!(
                        uv.distance(expected) < tolerance,
                        "{n} {turn:?}: {uv:?} for {expected:?}, {:?} from the border",
                        triangle.distance
                    );
                }
                let middle = (triangle.uv[0] + triangle.uv[1] + triangle.uv[2]) / 3.0;
                farthest = farthest.max(middle.x - 0.35);
                area += 0.5 * vrtm_core::mesh::triangle::doubled_area(triangle.uv).abs();
            }
            // What lies within the reach is there, also where the mesh's triangles are larger than that.
            assert!(area > 0.5 * 0.9 * reach, "{n}: {area}");
            assert!(farthest < 2.0 * reach, "{n}: {farthest}");
        }
    }
}

#[test]
fn a_tube_goes_on_where_it_began() {
    fn tube(x: f64, y: f64) -> [f32; 3] {
        // As high as its 24 chords are long together, so that the UVs have the shape of the surface.
        let ([sin, cos], height) = (
            <[f64; 2]>::from((std::f64::consts::TAU * x).sin_cos()),
            48.0 * (std::f64::consts::PI / 24.0).sin(),
        );
        [sin as f32, (height * y) as f32, cos as f32]
    }
    let sheet =
        Sheet { n: 24, cut: 24, point: tube, turn: DMat2::IDENTITY, shift: DVec2::ZERO, closed: true };
    let mesh = sheet.mesh();
    assert_eq!(mesh.info.charts, 1);
    let collar = &of_tile(&mesh, 0, 0.06)[0];
    let sides = [-0.5, 0.5].map(|shift| {
        let near = |t: &&CollarTriangle| (t.uv[0].x - source(&mesh, t)[0].x - shift).abs() < 0.1;
        let found: Vec<_> = collar.iter().filter(near).collect();
        for triangle in &found {
            for (uv, source) in triangle.uv.into_iter().zip(source(&mesh, triangle)) {
                assert!(uv.distance(source + DVec2::new(shift, 0.0)) < 1e-6, "{uv:?} {source:?}");
            }
        }
        found.len()
    });
    assert!(sides[0] > 0 && sides[0] == sides[1] && sides[0] + sides[1] == collar.len(), "{sides:?}");
}

#[test]
fn a_dome_keeps_shapes_and_sizes_near_the_seam() {
    fn dome(x: f64, y: f64) -> [f32; 3] {
        let (x, y) = (x - 0.5, y - 0.5);
        [x as f32, y as f32, (1.0 - x * x - y * y).sqrt() as f32]
    }
    let sheet = Sheet {
        n: 30,
        cut: 15,
        point: dome,
        turn: DMat2::from_cols_array(&[-1.0, 0.0, 0.0, -1.0]),
        shift: DVec2::new(1.3, 1.0),
        closed: false,
    };
    let mesh = sheet.mesh();
    let collar = &of_tile(&mesh, 0, 0.06)[0];
    assert!(collar.len() > 100);
    let areas: Vec<f64> = collar
        .iter()
        .map(|t| {
            let of = |corners: [DVec2; 3]| vrtm_core::mesh::triangle::doubled_area(corners);
            // The second chart is turned by half a turn, not mirrored.
            of(t.uv) / of(source(&mesh, t))
        })
        .collect();
    // The sheet's own UVs are stretched by up to a quarter at its ends.
    assert!(areas.iter().all(|a| (0.7..1.5).contains(a)), "{areas:?}");
}

#[test]
fn a_chart_shrunk_to_a_dot_does_not_take_the_whole_mesh() {
    let shrunk = 1e-3;
    let turn = DMat2::from_diagonal(DVec2::splat(shrunk));
    let sheet = Sheet { n: 64, cut: 63, point: flat, turn, shift: DVec2::splat(0.01), closed: false };
    let collar = &of_tile(&sheet.mesh(), 0, 0.5)[1];
    // A column of 64 quads of a sheet of side 1 is 1/64 wide.
    let widest = collar.iter().flat_map(|t| t.distance).fold(0.0, f64::max) / (0.5 * shrunk);
    assert!((0.01..0.03).contains(&widest), "{widest}");
}

#[test]
fn nothing_lies_beyond_a_border_of_the_mesh_or_an_edge_of_three_triangles() {
    let whole = Sheet { n: 6, cut: 6, point: flat, turn: DMat2::IDENTITY, shift: DVec2::ZERO, closed: false };
    assert!(of_tile(&whole.mesh(), 0, 0.1)[0].is_empty());
    // Three triangles around an edge, each a chart of its own.
    let rest = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let indices = [0, 1, 2, 0, 1, 3, 0, 1, 4];
    let uvs = [0.1f32, 0.4, 0.7].map(|x| [[x, 0.1], [x, 0.2], [x + 0.1, 0.1]]);
    let corners: Vec<u32> = (0..9).collect();
    let mesh = Mesh::new(&MeshSource {
        positions: Strided::from_slice(&rest),
        indices: &indices,
        uvs: UvSource { u: Strided::from_slice(uvs.as_flattened()), v: None, indices: Some(&corners) },
        ..MeshSource::default()
    })
    .unwrap();
    assert_eq!(mesh.info.charts, 3);
    assert!(of_tile(&mesh, 0, 0.1).iter().all(|collar| collar.is_empty()));
}
