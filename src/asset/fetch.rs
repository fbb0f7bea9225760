//! Writes a tile's last result as an image.

use std::sync::atomic::{AtomicPtr, Ordering};

use half::f16;

use crate::cpu::{Team, invert};
use crate::device::Device;
use crate::error::Result;
use crate::image::{ImageViewMut, PixelFormat, TexelLayout};
use crate::mesh::{Corner, NONE};
use crate::tile::blocks::{SIDE, slot};

use super::output::Outputs;
use super::solved::Solved;

/// The content of a fetched image: two channels (u, v) per texel, f32 or f16.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FetchKind {
    /// Inverse warp at texel centres, absolute within the tile (0..1). f16 holds less than a texel from 1024 on.
    Redirection,
    /// The same less the texel centre itself, in UV.
    RedirectionDelta,
    /// The warp itself at the nodes, absolute within the tile; (nx+1) x (ny+1) texels give the nodes exactly, any
    /// other size its bilinear interpolation from corner to corner.
    Warp,
}

/// Texels of an image that several threads write, each its own.
struct Canvas {
    pixels: AtomicPtr<u8>,
    layout: TexelLayout,
}

impl Canvas {
    fn new(image: &mut ImageViewMut) -> Canvas {
        Canvas { pixels: AtomicPtr::new(image.as_mut_ptr()), layout: image.layout }
    }

    /// Writes one texel; row 0 is at v = 0.
    fn put(&self, x: usize, y: usize, uv: [f64; 2]) {
        assert!(x < self.layout.width as usize && y < self.layout.height as usize);
        let at = self.layout.offset(x, y);
        // SAFETY: `ImageViewMut` checked that every texel of the layout lies in its bytes. Two threads never write one
        // texel: a warp without folds covers each texel once, and one with folds is written by one thread (`Outputs::invert`).
        unsafe {
            let to = self.pixels.load(Ordering::Relaxed).add(at);
            match self.layout.format {
                PixelFormat::F16 => {
                    let pair = uv.map(|x| f16::from_f32(x as f32));
                    to.cast::<[f16; 2]>().write_unaligned(pair);
                }
                _ => to.cast::<[f32; 2]>().write_unaligned(uv.map(|x| x as f32)),
            }
        }
    }
}

/// Writes `kind` of a result.
pub(super) fn write(
    device: &Device,
    team: &Team,
    solved: &Solved,
    outputs: &mut Outputs,
    kind: FetchKind,
    image: &mut ImageViewMut,
) -> Result<()> {
    let size = [image.layout.width as usize, image.layout.height as usize];
    let canvas = Canvas::new(image);
    let level = &solved.grid.levels[0];
    let cells = [level.nx as f64, level.ny as f64];
    match kind {
        FetchKind::Redirection => {
            outputs.invert(device, team, solved, size, |x, y, uv, _| canvas.put(x, y, uv))?;
        }
        FetchKind::RedirectionDelta => {
            outputs.invert(device, team, solved, size, |x, y, _, delta| canvas.put(x, y, delta))?;
        }
        FetchKind::Warp => {
            let nodes = dense(solved)?;
            let width = level.nx + 1;
            team.run(size[1], |y| {
                for x in 0..size[0] {
                    let [(i, s), (j, t)] = [(x, 0), (y, 1)].map(|(k, axis)| {
                        let last = (size[axis] - 1).max(1) as f64;
                        let at = k as f64 * cells[axis] / last;
                        let cell = at.floor().min(cells[axis] - 1.0);
                        (cell as usize, at - cell)
                    });
                    let u = |di: usize, dj: usize, k: usize| f64::from(nodes[(j + dj) * width + i + di][k]);
                    let uv = [(i, s, 0), (j, t, 1)].map(|(cell, along, k)| {
                        let low = u(0, 0, k) + s * (u(1, 0, k) - u(0, 0, k));
                        let high = u(0, 1, k) + s * (u(1, 1, k) - u(0, 1, k));
                        (cell as f64 + along + low + t * (high - low)) / cells[k]
                    });
                    canvas.put(x, y, uv);
                }
            });
        }
    }
    Ok(())
}

/// Displacements of all nodes of the tile, row by row from v = 0.
pub(super) fn dense(solved: &Solved) -> Result<Vec<[f32; 2]>> {
    let u = solved.warp.host()?;
    let level = &solved.grid.levels[0];
    let width = level.nx + 1;
    let mut nodes = vec![[0.0f32; 2]; width * (level.ny + 1)];
    for (b, block) in level.blocks.list.iter().enumerate().filter(|(_, block)| block.active) {
        for j in 0..SIDE {
            for i in 0..SIDE {
                let (x, y) = (block.x as usize * SIDE + i, block.y as usize * SIDE + j);
                let s = slot(i, j);
                // Where charts share a block, each has its own movable nodes.
                if level.movable[b][s] != 0 && x <= level.nx && y <= level.ny {
                    nodes[y * width + x] = [u[b][0][s], u[b][1][s]];
                }
            }
        }
    }
    Ok(nodes)
}

/// Redirected UVs of all face corners of a UV set.
pub(super) fn corner_uvs(
    team: &Team,
    corners: &[Corner],
    tiles: &[&Solved],
    out: &mut [[f32; 2]],
) -> Result<()> {
    let warps: Vec<_> = tiles.iter().map(|solved| solved.warp.host()).collect::<Result<_>>()?;
    const CHUNK: usize = 64;
    let canvas = AtomicPtr::new(out.as_mut_ptr());
    let count = out.len().min(corners.len());
    team.run(count.div_ceil(CHUNK), |k| {
        for (c, corner) in corners.iter().enumerate().take(((k + 1) * CHUNK).min(count)).skip(k * CHUNK) {
            let mut uv = corner.uv;
            if corner.tile != NONE && corner.triangle != NONE {
                let (solved, u) = (tiles[corner.tile as usize], warps[corner.tile as usize]);
                let level = &solved.grid.levels[0];
                let tile = solved.mesh.udim - 1001;
                let origin = [f64::from(tile % 10), f64::from(tile / 10)];
                let cells = [level.nx as f64, level.ny as f64];
                let c = [0, 1].map(|k| (f64::from(corner.uv[k]) - origin[k]) * cells[k]);
                let moved = solved
                    .candidates(solved.mesh.chart_of[corner.triangle as usize])
                    .find_map(|chart| invert::point(level, u, chart, c, solved.reach(chart)));
                if let Some(p) = moved {
                    uv = [0, 1].map(|k| (p[k] / cells[k] + origin[k]) as f32);
                }
            }
            // SAFETY: each item writes its own corners, all within `out`.
            unsafe { canvas.load(Ordering::Relaxed).add(c).write(uv) };
        }
    });
    Ok(())
}
