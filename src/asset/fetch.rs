//! Writes a tile's last result as an image.

use std::sync::atomic::{AtomicPtr, Ordering};

use crate::cpu::invert;
use crate::device::Device;
use crate::error::Result;
use crate::image::ImagePart;
use crate::image::ImageViewMut;
use crate::memory::Collect;
use crate::mesh::{Corner, NONE};
use crate::team::Team;
use crate::tile::blocks::Plane;

use super::canvas::Canvas;
use super::kind::FetchKind;
use super::nodes::{self, NodeRows};
use super::output::{Centres, Outputs};
use super::solved::Solved;

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

impl<'a> Output<'a> {
    pub fn new(solved: &'a Solved, kind: FetchKind, part: &ImagePart) -> Result<Output<'a>> {
        let content = match kind {
            FetchKind::Redirection => Content::Inverse { centres: Centres::new(part), is_delta: false },
            FetchKind::RedirectionDelta => Content::Inverse { centres: Centres::new(part), is_delta: true },
            FetchKind::Warp => {
                Content::Warp { nodes: NodeRows::new(solved)?, rows: nodes::rows(solved, part) }
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
            Content::Warp { nodes, rows } => nodes::write(team, solved, &part, &nodes, rows, &canvas),
        }
        Ok(())
    }
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
