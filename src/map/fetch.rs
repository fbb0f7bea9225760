//! Writes a tile's last result as an image.

use std::sync::atomic::{AtomicPtr, Ordering};

use crate::device::Device;
use vrtm_core::allocation::Vec;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::grid::planes::Plane;
use vrtm_core::image::{ImagePart, ImageViewMut, TexelLayout};
use vrtm_core::mesh::{Corner, Mesh, NONE};
use vrtm_core::team::Team;

use super::canvas::Canvas;
use super::inverse::{self, Area, Centres, Outputs, Room};
use super::nodes::{self, NodeRows};
use super::uv_set::OtherSet;
use super::{FetchKind, Form};
use crate::solved::Solved;
use vrtm_beyond::bands::Bands;
use vrtm_beyond::gutter::LimitedTexels;
use vrtm_beyond::owners::Owners;

/// The channel that marks the texels covered by charts.
const ALPHA: usize = 3;

/// An output that is about to be written: a `kind` of image of a result, or a part of it. It holds all CPU memory that
/// writing needs, so that nothing is written if memory runs short.
pub(crate) struct Output<'a> {
    pub solved: &'a Solved,
    part: ImagePart,
    /// The charts of texels, where the charts of the result may lie over one another.
    owners: Option<Owners>,
    /// Texels with a redirection that was clamped to the gutter.
    limited: LimitedTexels,
    content: Content<'a>,
}

enum Content<'a> {
    Inverse { form: Form, centres: Centres, coverage: Option<Bands<bool>> },
    Jacobian { is_scale: bool },
    Warp { nodes: NodeRows<'a>, rows: Vec<Vec<[f32; 2]>> },
    OtherSet { centres: Centres, set: OtherSet<'a> },
}

impl<'a> Output<'a> {
    /// An output for an image with this layout, whose channels have been checked.
    pub fn new(
        mesh: &Mesh,
        solved: &'a Solved,
        kind: FetchKind,
        part: &ImagePart,
        image: &TexelLayout,
    ) -> Result<Output<'a>> {
        let content = match kind {
            FetchKind::Redirection | FetchKind::RedirectionDelta | FetchKind::RedirectionUdim => {
                Content::Inverse {
                    form: Form::new(kind, &solved.mesh),
                    centres: Centres::new(part),
                    coverage: (image.channels as usize > ALPHA).then(|| Bands::new(part, false)),
                }
            }
            FetchKind::UvSet(uv_set) | FetchKind::UvSetDelta(uv_set) => {
                mesh.check_uv_set(uv_set)?;
                if part.extent() != part.size {
                    let message = "kind: UVs of another set are written as a whole image, not as a rectangle";
                    return Err(Error::new(ErrorKind::Unsupported, message));
                }
                let is_delta = matches!(kind, FetchKind::UvSetDelta(_));
                let set = OtherSet::new(mesh, solved, uv_set, is_delta, part);
                Content::OtherSet { centres: Centres::new(part), set }
            }
            FetchKind::Jacobian => Content::Jacobian { is_scale: false },
            FetchKind::FilterScale => Content::Jacobian { is_scale: true },
            FetchKind::Warp => {
                Content::Warp { nodes: NodeRows::new(solved)?, rows: nodes::rows(solved, part) }
            }
        };
        let inverts = !matches!(content, Content::Warp { .. });
        let owners = solved.extended.as_ref().filter(|_| inverts).map(|_| Owners::new(part));
        Ok(Output { solved, part: *part, owners, limited: LimitedTexels::default(), content })
    }

    /// Writes the output to `image`, which has the size of the part. Returns what was limited of a redirection.
    pub fn write(
        self,
        device: &Device,
        team: &Team,
        outputs: &mut Outputs,
        image: &mut ImageViewMut,
    ) -> Result<Option<LimitedTexels>> {
        let Output { solved, part, mut owners, limited, content } = self;
        if let (Some(owners), Some(tile)) = (&mut owners, &solved.extended) {
            owners.draw(team, tile);
        }
        let is_redirection = matches!(content, Content::Inverse { .. } | Content::OtherSet { .. });
        let gutter = solved.gutter.as_ref().filter(|_| is_redirection);
        let room = gutter.map(|gutter| Room { gutter, limited: &limited });
        let canvas = Canvas::new(image);
        let (part, canvas, owners) = (&part, &canvas, owners.as_ref());
        let area = Area { device, team, solved, part, canvas, owners, room };
        match content {
            Content::Inverse { form, centres, coverage } => {
                if !outputs.redirect(&area, form)? {
                    outputs.invert(&area, &centres, |_, _, uv, delta| {
                        let [u, v] = form.value(uv, delta);
                        [u, v, 0.0]
                    })?;
                }
                if let Some(mut coverage) = coverage {
                    coverage.draw(team, &solved.mesh.triangles, |t| t.uv, |_, _, _, covered| *covered = true);
                    team.run(part.extent()[1], |y| {
                        let row = coverage.row(y).iter().enumerate();
                        canvas.put_from(ALPHA, row.map(|(x, &covered)| (x, y, [f64::from(covered)])));
                    });
                }
            }
            Content::Jacobian { is_scale } => {
                if is_scale {
                    inverse::jacobians(&area, |j| [largest_stretch(j)])?;
                } else {
                    inverse::jacobians(&area, |[[a, b], [c, d]]| [a, b, c, d])?;
                }
            }
            Content::OtherSet { centres, set } => {
                let set = set.draw(team);
                outputs.invert(&area, &centres, |x, y, uv, delta| set.texel(x, y, uv, delta))?;
            }
            Content::Warp { nodes, rows } => nodes::write(&area, &nodes, rows),
        }
        Ok(is_redirection.then_some(limited))
    }
}

/// The largest singular value of a matrix.
fn largest_stretch([[a, b], [c, d]]: [[f64; 2]; 2]) -> f64 {
    // The singular values are the sum and the difference of the norms of the matrix's rotating and mirroring parts.
    let turning = ((a + d) * (a + d) + (c - b) * (c - b)).sqrt();
    let mirroring = ((a - d) * (a - d) + (c + b) * (c + b)).sqrt();
    0.5 * (turning + mirroring)
}

/// Redirected UVs of all face corners of a UV set; the mesh's own UVs in tiles without a result.
pub(crate) fn corner_uvs(
    team: &Team,
    corners: &[Corner],
    tiles: &[Option<&Solved>],
    out: &mut [[f32; 2]],
) -> Result<()> {
    let warps = tiles.iter().map(|solved| solved.map(|solved| solved.warp.host()).transpose());
    let warps: Vec<Option<&[[Plane; 2]]>> = warps.collect::<Result<Vec<_>>>()?;
    const CHUNK: usize = 64;
    let canvas = AtomicPtr::new(out.as_mut_ptr());
    let count = out.len().min(corners.len());
    team.run(count.div_ceil(CHUNK), |k| {
        for (c, corner) in corners.iter().enumerate().take(((k + 1) * CHUNK).min(count)).skip(k * CHUNK) {
            let mut uv = corner.given;
            if corner.tile != NONE
                && corner.triangle != NONE
                && let (Some(solved), Some(u)) = (tiles[corner.tile as usize], warps[corner.tile as usize])
            {
                let redirected = solved.redirected(u, corner.triangle, uv.map(f64::from));
                uv = redirected.map_or(uv, |uv| uv.map(|x| x as f32));
            }
            // SAFETY: each item writes its own corners, all within `out`.
            unsafe { canvas.load(Ordering::Relaxed).add(c).write(uv) };
        }
    });
    Ok(())
}
