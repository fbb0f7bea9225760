//! Tests with synthetic warps without folds: displacements of neighbours differ by at most half a cell in u, and by at
//! most a quarter in v if they differ there at all.

use super::*;
use crate::context::tests::gpu;
use crate::records::block_records;
use crate::results::ResultBuffers;
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::backend::Options;
use vrtm_core::fixtures::maps;
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::{NODES, Plane, SIDE, node_at};
use vrtm_core::mesh::{Mesh, MeshSource, UvSource};
use vrtm_core::report::TileReport;
use vrtm_core::settings::TileSettings;
use vrtm_core::team::Team;
use vrtm_core::view::Strided;
use vrtm_cpu::invert as twin;

/// A grid with charts over rectangles of cells (x, y, width, height), all of them rigid.
fn grid(cells: [u32; 2], charts: &[[u32; 4]]) -> Arc<Grid> {
    let corners = charts.iter().flat_map(|&[x, y, w, h]| [[x, y], [x + w, y], [x + w, y + h], [x, y + h]]);
    let uvs: Vec<[f32; 2]> =
        corners.map(|c| [0, 1].map(|axis| (f64::from(c[axis]) / f64::from(cells[axis])) as f32)).collect();
    let positions: Vec<[f32; 3]> = uvs.iter().map(|uv| [uv[0], uv[1], 0.0]).collect();
    let indices: Vec<u32> = (0..uvs.len() as u32).collect();
    let mesh = Mesh::new(&MeshSource {
        positions: Strided::from_slice(&positions),
        face_counts: Some(&vec![4; charts.len()]),
        indices: &indices,
        uvs: UvSource { u: Strided::from_slice(&uvs), v: None, indices: None },
        ..MeshSource::default()
    });
    let mesh = mesh.unwrap();
    let settings = TileSettings { grid: cells.map(Some), ..TileSettings::default() };
    let maps = maps(1, settings, |_, _| 1.0);
    Arc::new(Grid::new(&mesh, &mesh.tiles[0], &maps))
}

/// Displacements of movable nodes from a function of the node.
fn displace(grid: &Grid, f: impl Fn(usize, usize) -> [f32; 2]) -> Vec<[Plane; 2]> {
    let level = &grid.levels[0];
    let planes = |(b, block): (usize, &vrtm_core::grid::blocks::Block)| {
        let mut u_block = [[0.0; NODES]; 2];
        for s in (0..NODES).filter(|&s| level.movable[b][s] != 0) {
            let (i, j) = node_at(s);
            let u = f(block.x as usize * SIDE + i, block.y as usize * SIDE + j);
            (u_block[0][s], u_block[1][s]) = (u[0], u[1]);
        }
        u_block
    };
    level.blocks.list.iter().enumerate().map(planes).collect()
}

/// Displacement of a node.
type Warp<'a> = &'a dyn Fn(usize, usize) -> [f32; 2];

/// A pseudo-random number in -1..1 for a node.
fn noise(i: usize, j: usize, salt: usize) -> f32 {
    let mut x = (i as u64) << 32 | (j as u64) << 2 | salt as u64;
    for _ in 0..3 {
        x = (x ^ (x >> 31)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
    (x >> 40) as f32 / (1 << 23) as f32 - 1.0
}

/// A smooth displacement of the nodes around a centre, with noise.
fn push(centre: [f32; 2], radius: f32, by: [f32; 2]) -> impl Fn(usize, usize) -> [f32; 2] {
    move |i, j| {
        let d = [i as f32 - centre[0], j as f32 - centre[1]].map(|x| (x / radius).clamp(-1.0, 1.0));
        let fraction = (1.0 - d[0] * d[0]).powi(2) * (1.0 - d[1] * d[1]).powi(2);
        [0, 1].map(|k| fraction * by[k] + 0.1 * noise(i, j, k))
    }
}

fn upload(context: &Arc<Context>, grid: &Arc<Grid>, u: &[[Plane; 2]]) -> Displacements {
    let records = block_records(grid, 0, 0..u.len());
    let storage = wgpu::BufferUsages::STORAGE;
    let blocks = context.filled("blocks", bytemuck::cast_slice(&records), storage).unwrap();
    // The triangles under W do not matter here; they follow the displacements.
    let planes: Vec<[Plane; 3]> = u.iter().map(|&[x, y]| [x, y, [f32::NAN; NODES]]).collect();
    let planes = bytemuck::cast_slice(planes.as_flattened().as_flattened());
    let state = context.filled("result", planes, storage).unwrap();
    Displacements::new(context.clone(), grid.clone(), Arc::new(ResultBuffers { state, blocks }))
}

fn inverse(output: &Output, u: &Displacements, size: [usize; 2]) -> Vec<[f32; 2]> {
    let mut all = Vec::new();
    let mut read = |row: usize, texels: &[[f32; 2]]| {
        assert_eq!(all.len(), row * size[0]);
        all.extend_from_slice(texels);
    };
    output.invert(u, size, &mut read).unwrap();
    assert_eq!(all.len(), size[0] * size[1]);
    all
}

/// A kernel that counts how often each texel is written; with `exact` it decides by integers alone.
fn counting(context: &Context, exact: bool) -> Pipeline {
    let source = Kernel::Invert.source();
    let mut text = source.text(0);
    let mut change = |from: &str, to: &str| {
        assert_eq!(text.matches(from).count(), 1, "{from}");
        text = text.replace(from, to);
    };
    change("image: array<vec2f>", "image: array<atomic<u32>>");
    // A NaN counts as 99 writes.
    change("image[at] = -p;", "atomicAdd(&image[at], select(1u, 99u, any(p != p)));");
    if exact {
        change("if abs(plus - minus) > 0x1p-20 * (abs(plus) + abs(minus))", "if request.bits == 99u");
    }
    Pipeline::from_text(&context.device, source, text)
}

/// Number of writes to each texel.
fn writes(output: &Output, counting: &Pipeline, u: &Displacements, size: [usize; 2]) -> Vec<u32> {
    let mut all = Vec::new();
    // The counts, one per texel, fill the first half of the image's bytes.
    let mut read = |_, bytes: &[u8]| all.extend_from_slice(bytemuck::cast_slice(&bytes[..bytes.len() / 2]));
    output.run(counting, u, size, None, &mut read).unwrap();
    all
}

/// Per cell, row by row, whether it has a movable corner. All other cells stay at rest, as do the edges between cells
/// of both kinds.
fn visited(grid: &Grid) -> Vec<bool> {
    let level = &grid.levels[0];
    let mut cells = vec![false; level.nx * level.ny];
    for (b, block) in level.blocks.list.iter().enumerate() {
        for s in (0..NODES).filter(|&s| level.movable[b][s] != 0) {
            let (i, j) = node_at(s);
            let (x, y) = (block.x as usize * SIDE + i, block.y as usize * SIDE + j);
            for (x, y) in [(x - 1, y - 1), (x, y - 1), (x - 1, y), (x, y)] {
                cells[y * level.nx + x] = true;
            }
        }
    }
    cells
}

fn sizes(n: usize, m: usize) -> [[usize; 2]; 12] {
    [
        [n, m],
        [n / 2, m / 2],
        [2 * n, 2 * m],
        [4 * n, 4 * m],
        [n * 3 / 4 + 5, m * 5 / 4 + 3],
        [n + 1, m - 1],
        [7, 3 * m],
        [1, 1],
        [1, m],
        [n, 1],
        [3, 5],
        [509, 521],
    ]
}

/// Tests ties. If nodes move by eighths of cells, nodes and edges meet texel centres; if they nearly do, they nearly
/// meet.
#[test]
fn each_texel_centre_falls_to_one_triangle() {
    let Some(context) = gpu(Options::default()).map(Arc::new) else { return };
    let kernels = [false, true].map(|exact| counting(&context, exact));
    for (cells, charts) in [
        ([16, 16], vec![[1, 0, 15, 16]]),
        ([64, 64], vec![[3, 5, 50, 41]]),
        ([96, 32], vec![[0, 0, 96, 32]]),
        ([80, 112], vec![[0, 0, 37, 112], [37, 0, 43, 60], [37, 60, 43, 52]]),
    ] {
        let grid = grid(cells, &charts);
        let visited = visited(&grid);
        let eighths = |i, j| [0, 1].map(|k| (noise(i, j, k) * [2.5, 1.5][k]).round() * 0.125);
        let nearly = |i, j| [0, 1].map(|k| eighths(i, j)[k] + 7e-8 * noise(i, j, k + 2));
        let middle = if cells[0] < 64 { 8.0 } else { 19.0 };
        let pushed = push([middle; 2], middle - 5.0, [0.1 * middle, -0.06 * middle]);
        let tiny = |i, j| [0, 1].map(|k| noise(i, j, k) * 1e-9);
        let warps: [(&str, Warp); 5] = [
            ("eighths", &eighths),
            ("nearly eighths", &nearly),
            ("pushed", &pushed),
            ("hardly", &tiny),
            ("up", &|_, _| [0.0, 1e-3]),
        ];
        for (name, warp) in warps {
            // All movable nodes move, so all cells around them are visited.
            let moved = |i, j| {
                let u = warp(i, j);
                if u == [0.0; 2] { [1e-30, 0.0] } else { u }
            };
            let u = upload(&context, &grid, &displace(&grid, moved));
            let [nx, ny] = cells.map(|n| n as usize);
            let bits = bits([nx, ny]);
            for size in sizes(nx, ny) {
                let output = Output::new(&context, size, PixelFormat::F32).unwrap();
                let [xs, ys] = [(size[0], nx), (size[1], ny)]
                    .map(|(texels, cells)| centres(texels, cells, bits).collect::<Vec<i32>>());
                for kernel in &kernels {
                    for (k, &count) in writes(&output, kernel, &u, size).iter().enumerate() {
                        let texel = [k % size[0], k / size[0]];
                        let [x, y] = [xs[texel[0]], ys[texel[1]]].map(|c| (c >> bits) as usize);
                        let expected = u32::from(visited[y * nx + x]);
                        assert_eq!(count, expected, "{name}, {cells:?} to {size:?}: texel {texel:?}");
                    }
                }
            }
        }
    }
}

/// The largest difference from the CPU's inverse of the same displacements, in texels.
fn compare(context: &Arc<Context>, grid: &Arc<Grid>, u: &[[Plane; 2]], size: [usize; 2]) -> f64 {
    let on_device = upload(context, grid, u);
    let output = Output::new(context, size, PixelFormat::F32).unwrap();
    let found = inverse(&output, &on_device, size);
    let level = &grid.levels[0];
    let scale = [size[0] as f64 / level.nx as f64, size[1] as f64 / level.ny as f64];
    let mut expected = vec![[0.0f64; 2]; size[0] * size[1]];
    let texels = std::sync::Mutex::new(&mut expected);
    Team::with(1, |team| {
        let part = vrtm_core::image::ImagePart { size, first: [0, 0], end: size };
        let mut report = TileReport::default();
        report.max_displacement = 1e4;
        twin::texels(team, grid, None, u, &part, &report, &|found| {
            for texel in found.texels {
                let [x, y] = texel.at.map(|k| k as usize);
                let centre = [x, y].map(|k| k as f64 + 0.5);
                texels.lock().unwrap()[y * size[0] + x] =
                    [0, 1].map(|k| texel.point[k] - centre[k] / scale[k]);
            }
        });
    });
    let mut worst = 0.0f64;
    for (found, expected) in found.iter().zip(&expected) {
        let off = [0, 1].map(|k| (f64::from(found[k]) - expected[k]) * scale[k]);
        worst = worst.max(off[0].hypot(off[1]));
        assert!(worst.is_finite());
    }
    worst
}

#[test]
fn the_inverse_is_the_cpu_s() {
    let Some(context) = gpu(Options::default()).map(Arc::new) else { return };
    let small = [[0, 0, 60, 128], [60, 0, 36, 128]];
    // Near the far corner of a large grid, where absolute coordinates have the lowest precision.
    let large = [[3700, 3800, 380, 280]];
    let far = push([3900.0, 3940.0], 135.0, [24.0, -18.0]);
    for (cells, charts, warp) in [
        ([96, 128], &small[..], &push([30.0, 60.0], 28.0, [5.0, -3.0]) as Warp),
        ([4096, 4096], &large[..], &far),
    ] {
        let grid = grid(cells, charts);
        let u = displace(&grid, warp);
        let large = cells[0] > 1000;
        let sizes = sizes(cells[0] as usize, cells[1] as usize);
        // Precision depends on the cells; as many texels as cells would only take longer.
        for &size in if large { &sizes[1..2] } else { &sizes[..] } {
            let worst = compare(&context, &grid, &u, size);
            println!("{cells:?} to {size:?}: {worst:.1e} texel");
            // The lattice has at least 2^16 steps per cell; barycentric coordinates and the displacement itself, of
            // some cells in length, are f32 with a relative precision of 2^-24. Measured: under 1e-6 cells.
            assert!(worst < 1e-5 * (size[0] as f64 / f64::from(cells[0])).max(1.0), "{size:?}: {worst}");
        }
    }
}

#[test]
fn bands_of_rows_give_the_same_bits() {
    let Some(context) = gpu(Options { webgpu_limits: true, ..Options::default() }).map(Arc::new) else {
        return;
    };
    let grid = grid([112, 96], &[[0, 0, 50, 96], [50, 0, 62, 90]]);
    let u = upload(&context, &grid, &displace(&grid, push([25.0, 48.0], 22.0, [-4.0, 3.0])));
    let size = [133, 201];
    let whole = inverse(&Output::new(&context, size, PixelFormat::F32).unwrap(), &u, size);
    assert!(whole.iter().filter(|d| **d != [0.0; 2]).count() > 10_000);
    for rows in [1, 7, 64, 200] {
        let output =
            Output::with_max_binding(&context, size, PixelFormat::F32, rows * 133 * INVERSE_BYTES).unwrap();
        assert_eq!(output.staging.len(), 201usize.div_ceil(rows as usize));
        assert!(inverse(&output, &u, size) == whole, "{rows} rows");
        // Smaller images fit into the same buffers.
        assert!(output.holds([133, 100], PixelFormat::F32) && !output.holds([133, 202], PixelFormat::F32));
    }
}
