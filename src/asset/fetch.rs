//! Writes a tile's last result as an image.

use std::sync::atomic::{AtomicPtr, Ordering};

use half::f16;

use crate::cpu::invert;
use crate::device::Device;
use crate::error::Result;
use crate::image::ImagePart;
use crate::image::{ImageViewMut, PixelFormat, TexelLayout};
use crate::memory::{Collect, zeroed};
use crate::mesh::{Corner, NONE};
use crate::team::Team;
use crate::tile::Level;
use crate::tile::blocks::{Plane, SIDE, slot};

use super::output::{Centres, Outputs};
use super::solved::Solved;

/// The content of a fetched image: two channels (u, v) per texel, f32 or f16.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FetchKind {
    /// Inverse warp at texel centres, absolute within the tile (0..1). f16 holds less than a texel from 1024 on.
    Redirection,
    /// The same less the texel centre itself, in UV.
    RedirectionDelta,
    /// The warp itself, absolute within the tile, from border to border: (nx+1) x (ny+1) texels give the nodes exactly.
    /// At any other size each cell is two triangles, split by its diagonal from (0,0) to (1,1), and the warp is affine on
    /// each: what the redirection inverts.
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

/// An output that is about to be written: `kind` of a result, a part of an image of the tile. It has all memory that
/// writing takes on the CPU, so that nothing is written where some is missing.
pub(super) struct Output<'a> {
    pub solved: &'a Solved,
    part: ImagePart,
    content: Content<'a>,
}

enum Content<'a> {
    Inverse { centres: Centres, is_delta: bool },
    Warp { nodes: NodeRows<'a>, rows: Vec<Vec<[f32; 2]>> },
}

/// Most items of work that a warp is written in.
const ITEMS: usize = 64;

impl<'a> Output<'a> {
    pub fn new(solved: &'a Solved, kind: FetchKind, part: &ImagePart) -> Result<Output<'a>> {
        let content = match kind {
            FetchKind::Redirection => Content::Inverse { centres: Centres::new(part), is_delta: false },
            FetchKind::RedirectionDelta => Content::Inverse { centres: Centres::new(part), is_delta: true },
            FetchKind::Warp => {
                let width = 2 * (solved.grid.levels[0].nx + 1);
                let rows = (0..part.extent()[1].min(ITEMS)).map(|_| zeroed(width)).collected();
                Content::Warp { nodes: NodeRows::new(solved)?, rows }
            }
        };
        Ok(Output { solved, part: *part, content })
    }

    /// Writes it to `image`, which is as large as the part.
    pub fn write(
        self,
        device: &Device,
        team: &Team,
        outputs: &mut Outputs,
        image: &mut ImageViewMut,
    ) -> Result<()> {
        let Output { solved, part, content } = self;
        let canvas = Canvas::new(image);
        match content {
            Content::Inverse { centres, is_delta: false } => {
                outputs.invert(device, team, solved, &part, &centres, |x, y, uv, _| canvas.put(x, y, uv))?;
            }
            Content::Inverse { centres, is_delta: true } => {
                outputs.invert(device, team, solved, &part, &centres, |x, y, _, delta| {
                    canvas.put(x, y, delta);
                })?;
            }
            Content::Warp { nodes, rows } => write_warp(team, solved, &part, &nodes, rows, &canvas),
        }
        Ok(())
    }
}

/// Writes a warp; `rows` has two rows of nodes for each item of work.
fn write_warp(
    team: &Team,
    solved: &Solved,
    part: &ImagePart,
    nodes: &NodeRows,
    mut rows: Vec<Vec<[f32; 2]>>,
    canvas: &Canvas,
) {
    let level = &solved.grid.levels[0];
    let cells = [level.nx, level.ny].map(|n| n as f64);
    let [width, height] = part.extent();
    // The cell of a texel along an axis, and its place in it.
    let place = |x: usize, axis: usize| {
        let last = (part.size[axis] - 1).max(1) as f64;
        let at = (part.first[axis] + x) as f64 * cells[axis] / last;
        let cell = at.floor().min(cells[axis] - 1.0);
        (cell as usize, at - cell)
    };
    let items = rows.len();
    let write_row = |y: usize, rows: &mut [[f32; 2]]| {
        let (j, t) = place(y, 1);
        let (first, second) = rows.split_at_mut(level.nx + 1);
        nodes.read_row(j, first);
        nodes.read_row(j + 1, second);
        let rows = [first, second];
        for x in 0..width {
            let (i, s) = place(x, 0);
            let u = |di: usize, dj: usize, k: usize| f64::from(rows[dj][i + di][k]);
            // Along the longer of s and t to the triangle's third corner, then to the far one (method §9).
            let (third, first, second) = if s >= t { ([1, 0], s, t) } else { ([0, 1], t, s) };
            let uv = [(i, s, 0), (j, t, 1)].map(|(cell, along, k)| {
                let (near, far, third) = (u(0, 0, k), u(1, 1, k), u(third[0], third[1], k));
                let moved = near + first * (third - near) + second * (far - third);
                (cell as f64 + along + moved) / cells[k]
            });
            canvas.put(x, y, uv);
        }
    };
    team.fill(&mut rows, |k, rows| {
        (k * height / items..(k + 1) * height / items).for_each(|y| write_row(y, rows))
    });
}

/// The displacements of a result's nodes, row by row.
struct NodeRows<'a> {
    level: &'a Level,
    u: &'a [[Plane; 2]],
    /// The active blocks, sorted by their rows.
    blocks: Vec<u32>,
}

impl<'a> NodeRows<'a> {
    fn new(solved: &'a Solved) -> Result<NodeRows<'a>> {
        let level = &solved.grid.levels[0];
        let list = &level.blocks.list;
        let mut blocks: Vec<u32> = (0..list.len() as u32).filter(|&b| list[b as usize].active).collected();
        blocks.sort_unstable_by_key(|&b| (list[b as usize].y, b));
        Ok(NodeRows { level, u: solved.warp.host()?, blocks })
    }

    /// Reads row j, from u = 0.
    fn read_row(&self, j: usize, row: &mut [[f32; 2]]) {
        row.fill([0.0; 2]);
        let list = &self.level.blocks.list;
        let y = (j / SIDE) as u32;
        let first = self.blocks.partition_point(|&b| list[b as usize].y < y);
        for &b in self.blocks[first..].iter().take_while(|&&b| list[b as usize].y == y) {
            let b = b as usize;
            let x = list[b].x as usize * SIDE;
            for i in 0..SIDE.min(self.level.nx + 1 - x) {
                let s = slot(i, j % SIDE);
                // Where charts share a block, each has its own movable nodes.
                if self.level.movable[b][s] != 0 {
                    row[x + i] = [self.u[b][0][s], self.u[b][1][s]];
                }
            }
        }
    }
}

/// Displacements of all nodes of the tile, row by row from v = 0.
pub(super) fn dense(solved: &Solved) -> Result<Vec<[f32; 2]>> {
    let nodes = NodeRows::new(solved)?;
    let [width, height] = [nodes.level.nx + 1, nodes.level.ny + 1];
    let mut all = zeroed(width * height);
    all.chunks_exact_mut(width).enumerate().for_each(|(j, row)| nodes.read_row(j, row));
    Ok(all)
}

/// Redirected UVs of all face corners of a UV set; where a tile has no result, the mesh's own.
pub(super) fn corner_uvs(
    team: &Team,
    corners: &[Corner],
    tiles: &[Option<&Solved>],
    out: &mut [[f32; 2]],
) -> Result<()> {
    let warps = tiles.iter().map(|solved| solved.map(|solved| solved.warp.host()).transpose());
    let warps: Vec<Option<&[[Plane; 2]]>> = warps.try_collected()?;
    const CHUNK: usize = 64;
    let canvas = AtomicPtr::new(out.as_mut_ptr());
    let count = out.len().min(corners.len());
    team.run(count.div_ceil(CHUNK), |k| {
        for (c, corner) in corners.iter().enumerate().take(((k + 1) * CHUNK).min(count)).skip(k * CHUNK) {
            let mut uv = corner.uv;
            if corner.tile != NONE
                && corner.triangle != NONE
                && let (Some(solved), Some(u)) = (tiles[corner.tile as usize], warps[corner.tile as usize])
            {
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
