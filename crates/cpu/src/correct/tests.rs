use super::*;
use crate::Memory;
use crate::sampling::resample::Start as Resampling;
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::fixtures::{Posed, maps};
use vrtm_core::grid::planes::{EDGES, SIDE, slot};
use vrtm_core::method::plan::Purpose;
use vrtm_core::method::stage::{Stage, Stages, Start};
use vrtm_core::settings::TileSettings;
use vrtm_core::team::Team;

const GRID: usize = 64;

/// (xx, xy, yy) of the sum of a node's stored row, and the largest magnitude among the row's terms.
fn row_sum(run: &Run, level: usize, i: usize, j: usize) -> ([f64; 3], f64) {
    let rows = &run.memory.workspace.levels[level].rows;
    let find = |i: usize, j: usize| {
        let b = run.grid.levels[level].blocks.find(0, (i / SIDE) as i64, (j / SIDE) as i64) as usize;
        (b, slot(i % SIDE, j % SIDE))
    };
    let (b, s) = find(i, j);
    let mut sum = rows.diagonal[b].map(|plane| f64::from(plane[s]));
    let mut largest = sum[0].max(sum[2]);
    for (e, (di, dj)) in EDGES.into_iter().enumerate() {
        let owner = ((i as i64 - di) as usize, (j as i64 - dj) as usize);
        for (b, s) in [find(i, j), find(owner.0, owner.1)] {
            let [xx, xy, yx, yy] = rows::decode_one(rows.words_of(b)[e].map(|plane| plane[s])).map(f64::from);
            for (sum, x) in sum.iter_mut().zip([xx, 0.5 * (xy + yx), yy]) {
                *sum += x;
                largest = largest.max(x.abs());
            }
        }
    }
    (sum, largest)
}

#[test]
#[cfg_attr(miri, ignore = "too long; tests/sound runs the same code")]
fn a_body_moves_freely_whatever_its_pairs_were_rounded_to() {
    // On a flat surface only the fixed border resists a rigid motion of the whole surface. The sum of each row that has
    // no fixed neighbour is therefore 0, on every level.
    let stiff = |u: f64, v: f64| if (u - 0.5).hypot(v - 0.5) < 0.3 { 1.0 } else { 0.37 };
    let maps = maps(GRID, TileSettings::default(), stiff);
    let sheet = Posed::new(4, maps, |u, v| [1.31 * u + 0.17 * v, 0.83 * v - 0.09 * u, 0.0]);
    let grid = &sheet.grid;
    let mut memory = Memory::new(grid, Purpose::default());
    let mut result = vec![[[0.0; NODES]; 2]; grid.levels[0].blocks.list.len()];
    Team::with(1, |team| {
        let mut run = Run::new(team, &sheet.input(), &mut memory, &mut result, &[]);
        run.run(&Stage::Surface);
        run.run(&Stage::Pyramid { coarsest: 8 });
        run.run(&Stage::Start { level: 0, from: Start::Identity });
        let correction =
            Correction { first: true, iterations: 2, sweeps: 0, tolerance: 1e-3, trusts_model: true };
        run.run(&Stage::Correct { level: 0, correction });
        for level in 0..3 {
            let nodes = GRID >> level;
            // All nodes in these rows are movable: the fixed nodes are at least two nodes away.
            for (i, j) in (4..nodes - 3).flat_map(|j| (4..nodes - 3).map(move |i| (i, j))) {
                let (sum, largest) = row_sum(&run, level, i, j);
                let most = sum.into_iter().map(f64::abs).fold(0.0, f64::max);
                // Each of the eight pairs has a relative rounding error of up to 1/256, far above this bound.
                assert!(largest > 0.1 && most < 2e-5 * largest, "level {level}, ({i}, {j}): {sum:?}");
            }
        }
    });
}

/// A level's gradient, half of the derivative, along a random direction is that of finite differences of the energy;
/// and at rest, where no edge is strained, the matrix is half of the second derivative. Each node has a multiplier.
#[test]
#[cfg_attr(miri, ignore = "too long; tests/sound runs the same code")]
fn multipliers_are_in_energy_gradient_and_matrix_alike() {
    let stiff = |u: f64, v: f64| if (u - 0.5).hypot(v - 0.5) < 0.3 { 1.0 } else { 0.37 };
    let purpose = Purpose { weighs: true, ..Purpose::default() };
    for strained in [true, false] {
        // On a flat surface slopes are exact.
        let pose = |u: f64, v: f64| match strained {
            true => [1.06 * u + 0.02 * v, 0.97 * v - 0.01 * u, 0.0],
            false => [u, v, 0.0],
        };
        let sheet = Posed::new(4, maps(GRID, TileSettings::default(), stiff), pose);
        let mut memory = Memory::new(&sheet.grid, purpose);
        let mut result = vec![[[0.0; NODES]; 2]; sheet.grid.levels[0].blocks.list.len()];
        Team::with(1, |team| {
            let mut run = Run::new(team, &sheet.input(), &mut memory, &mut result, &[]);
            run.run(&Stage::Surface);
            run.run(&Stage::Pyramid { coarsest: 2 });
            for level in 0..3 {
                run.run(&Stage::Start { level, from: Start::Identity });
                let mut seed = 7u32;
                let mut random = || {
                    seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    (seed >> 8) as f32 / (1u32 << 23) as f32 - 1.0
                };
                let buffers = &mut run.memory.levels[level];
                buffers.is_weighed = true;
                let codes = buffers.multiplier.as_flattened_mut().iter_mut();
                codes.for_each(|code| *code = (8000.0 * (random() + 1.0)) as u16);
                let movable = sheet.grid.levels[level].movable.clone();
                let mut planes = |size: f32| {
                    let mut plane =
                        |b: usize| [0, 1].map(|_| movable[b].map(|free| size * random() * f32::from(free)));
                    (0..movable.len()).map(&mut plane).collect::<Vec<_>>()
                };
                let (at, along) = (planes(if strained { 0.05 } else { 0.0 }), planes(1.0));
                let energy = |run: &mut Run, t: f32| {
                    let (state, active) = (run.memory.levels[level].state(), &run.work[level].active);
                    run.move_and_resample(level, state, active, Resampling::Nearest, |b, u| {
                        for (u, (at, along)) in u.iter_mut().zip(at[b].iter().zip(&along[b])) {
                            *u = std::array::from_fn(|s| at[s] + t * along[s]);
                        }
                    });
                    run.energies(level)[0]
                };
                let t = if strained { 1e-3 } else { 0.02 };
                let [high, low, here] = [t, -t, 0.0].map(|t| energy(&mut run, t));
                let [rows, residual] = run.assembled(level);
                let along = along.as_flattened().as_flattened();
                let t = f64::from(t);
                if strained {
                    let product = |(r, v): (&u32, &f32)| -2.0 * f64::from(f32::from_bits(*r)) * f64::from(*v);
                    let (slope, measured) =
                        (residual.iter().zip(along).map(product).sum::<f64>(), (high - low) / (2.0 * t));
                    assert!(
                        (measured - slope).abs() < 0.01 * slope.abs(),
                        "level {level}: {measured} {slope}"
                    );
                } else {
                    let (curvature, measured) =
                        (curvature(&run, level, &rows, along), (high + low - 2.0 * here) / (2.0 * t * t));
                    assert!(
                        (measured / curvature - 1.0).abs() < 0.01,
                        "level {level}: {measured} {curvature}"
                    );
                }
            }
        });
    }
}

/// The product v A v of a level's matrix, in the layout of `Run::rows`.
fn curvature(run: &Run, level: usize, rows: &[u32], v: &[f32]) -> f64 {
    let blocks = &run.grid.levels[level].blocks;
    let vector = |b: usize, s: usize| [0, 1].map(|c| f64::from(v[(2 * b + c) * NODES + s]));
    let mut sum = 0.0;
    for (b, rows) in rows.chunks_exact(11 * NODES).enumerate() {
        for s in 0..NODES {
            let [x, y] = vector(b, s);
            let [xx, xy, yy] = [0, 1, 2].map(|c| f64::from(f32::from_bits(rows[c * NODES + s])));
            sum += xx * x * x + 2.0 * xy * x * y + yy * y * y;
            let (i, j) = vrtm_core::grid::planes::node_at(s);
            for (e, (di, dj)) in EDGES.into_iter().enumerate() {
                let [k, l] = [i as i64 + di, j as i64 + dj].map(|n| (n + SIDE as i64) as usize);
                let holder = blocks.neighbours[b][l / SIDE * 3 + k / SIDE];
                if holder == vrtm_core::mesh::NONE {
                    continue;
                }
                let far = vector(holder as usize, slot(k % SIDE, l % SIDE));
                let pair = rows::decode_one([0, 1].map(|c| rows[(3 + 2 * e + c) * NODES + s])).map(f64::from);
                sum += 2.0
                    * (x * (pair[0] * far[0] + pair[1] * far[1]) + y * (pair[2] * far[0] + pair[3] * far[1]));
            }
        }
    }
    sum
}

#[test]
#[cfg_attr(miri, ignore = "too long; tests/sound runs the same code")]
fn fractions_fall_off_by_the_slope() {
    let sheet = Posed::new(4, maps(GRID, TileSettings::default(), |_, _| 1.0), |u, v| [u, v, 0.0]);
    let grid = &sheet.grid;
    let mut memory = Memory::new(grid, Purpose::default());
    let level = &grid.levels[0];
    let count = level.blocks.list.len();
    let mut result = vec![[[0.0; NODES]; 2]; count];
    let at = |i: usize, j: usize| {
        (level.blocks.find(0, (i / SIDE) as i64, (j / SIDE) as i64) as usize, slot(i % SIDE, j % SIDE))
    };
    Team::with(2, |team| {
        let run = Run::new(team, &sheet.input(), &mut memory, &mut result, &[]);
        let active: Vec<u32> = (0..count as u32).filter(|&b| level.blocks.list[b as usize].active).collect();
        let mut step = vec![[[0.0f32; NODES]; 2]; count];
        let mut slope = |x: f32| {
            let (b, s) = at(40, 21);
            step[b][1][s] = x;
            falloff::slopes(&run, level, &active, &step)[0]
        };
        // The difference times the step is at most a quarter of a cell.
        assert_eq!([1.0, -2.0, -25.0].map(&mut slope), [0.125, 0.125, 0.01]);
        // Two nodes that take less, in different blocks.
        let less = [((20, 37), 0.0), ((45, 11), 0.25)];
        let mut fraction = vec![[[1.0f32; NODES]; 2]; count];
        for ((i, j), part) in less {
            let (b, s) = at(i, j);
            fraction[b][0][s] = part;
        }
        falloff::fall_off(&run, level, &active, SharedSlice::new(&mut fraction), &[0.01]);
        for (i, j) in (1..GRID).flat_map(|j| (1..GRID).map(move |i| (i, j))) {
            let (b, s) = at(i, j);
            let expected = less.iter().fold(1.0f32, |low, &((k, l), part)| {
                low.min(part + 0.01 * (i.abs_diff(k) + j.abs_diff(l)) as f32)
            });
            assert!((fraction[b][0][s] - expected).abs() < 1e-5, "({i}, {j}): {}", fraction[b][0][s]);
        }
    });
}

/// Around a stud, the V-cycle and the product with the matrix are the same if uniform blocks have rows like the others.
#[test]
#[cfg_attr(miri, ignore = "too long; tests/sound runs the same code")]
fn uniform_blocks_solve_as_others_do() {
    let stud = |u: f64, v: f64| f64::from((u - 0.25).hypot(v - 0.25) < 0.1);
    let maps = maps(2 * GRID, TileSettings::default(), stud);
    let sheet = Posed::new(4, maps, |u, v| [u + 0.3 * u * u, v, 0.0]);
    let mut memory = Memory::new(&sheet.grid, Purpose::default());
    let mut result = vec![[[0.0; NODES]; 2]; sheet.grid.levels[0].blocks.list.len()];
    Team::with(2, |team| {
        let mut run = Run::new(team, &sheet.input(), &mut memory, &mut result, &[]);
        run.run(&Stage::Surface);
        run.run(&Stage::Pyramid { coarsest: 8 });
        run.run(&Stage::Start { level: 0, from: Start::Identity });
        let mut workspace = std::mem::take(&mut run.memory.workspace);
        let mut assembling = workspace.assembling(0, &mut []);
        let (rows, residual) = assembling.system();
        run.with_surface(0, assemble::Assemble { rows, residual, level: 0 });
        let mut samples = std::mem::take(&mut run.memory.levels);
        let mut levels = assembling.solving(&mut samples).levels;
        run.complete_systems(0, &mut levels, true);
        let solve = |levels: &mut [SolvingLevel]| {
            multigrid::precondition(&run, 0, levels);
            let SolvingLevel { rows, direction, product, .. } = &mut levels[0];
            multigrid::multiply(&run, 0, rows, direction, product);
            let product = product.iter().flat_map(|planes| &planes[..2]);
            direction.as_flattened().iter().chain(product).flatten().copied().collect::<Vec<_>>()
        };
        let uniform = solve(&mut levels);
        let rows = &mut *levels[0].rows;
        assert!(rows.is_uniform.contains(&true) && rows.is_uniform.contains(&false));
        for b in 0..rows.is_uniform.len() {
            let (words, halo) = (*rows.words_of(b), *rows.block(b).halo);
            (rows.words[b], rows.halo[b], rows.is_uniform[b]) = (words, halo, false);
        }
        let other = solve(&mut levels);
        let most = other.iter().fold(0.0f32, |most, x| most.max(x.abs()));
        assert!(most > 0.01);
        for (x, y) in uniform.iter().zip(&other) {
            assert!((x - y).abs() < 1e-5 * most, "{x} {y}");
        }
    });
}
