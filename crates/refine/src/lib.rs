//! Refines a mesh so that corner UVs approximate a redirection closely: for hosts that support UV sets only. Its
//! triangles are split where linear interpolation of redirected corner UVs errs by more than a tolerance. The door is
//! [`RefinedMesh`]; results come through [`Redirection`].

#![allow(missing_docs, reason = "for the crates of vrtm alone")]
// Allocations sized by user input must be fallible: clippy.toml lists the infallible ones.
#![cfg_attr(not(test), warn(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types))]

// Ordered from the bottom up: a module imports only modules above it in this list. `tests/house/arrows.rs` checks this.
mod base;
mod redirection;
mod sparse;
mod error;
mod split;
mod passes;

use std::sync::Arc;

use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::mesh::Mesh;
use vrtm_core::team::Team;

use base::Base;
use split::{PieceCorner, Pieces, Splitter};

pub use passes::Redirections;
pub use redirection::Redirection;
pub use split::Source;

/// A mesh with its triangles split. A clone shares what both have, and can be refined separately.
#[derive(Clone, Debug)]
pub struct RefinedMesh {
    base: Arc<Base>,
    /// `None` before it is refined for the first time.
    pieces: Option<Arc<Pieces>>,
}

/// A corner of the refined mesh.
pub struct RefinedCorner {
    pub vertex: u32,
    pub uv_point: u32,
    /// Corners of the mesh.
    pub source: Source,
}

impl RefinedMesh {
    /// The mesh itself, with the corners of a UV set.
    pub fn new(mesh: &Mesh, uv_set: usize) -> RefinedMesh {
        RefinedMesh { base: Arc::new(Base::new(mesh, uv_set)), pieces: None }
    }

    /// Splits triangles until no error is above the tolerance, in UV, or there would be more than `most`. Returns the
    /// largest error left, and whether it is within the tolerance. Existing splits remain.
    pub fn refine(
        &mut self,
        team: &Team,
        mesh: &Mesh,
        results: &Redirections,
        tolerance: f64,
        most: usize,
    ) -> (f64, bool) {
        let mut splitter = match &self.pieces {
            None => Splitter::new(mesh, &self.base),
            Some(pieces) => Splitter::go_on(mesh, &self.base, (**pieces).clone()),
        };
        let uvs = &mut Vec::new();
        let outcome = passes::split(team, &mut splitter, results, tolerance, most, uvs);
        let mut pieces = splitter.pieces;
        pieces.whole = passes::whole(team, mesh, &self.base, &pieces, results, tolerance, uvs);
        self.pieces = Some(Arc::new(pieces));
        outcome
    }

    fn pieces(&self) -> &Pieces {
        self.pieces.as_ref().expect("it is refined as soon as it is made")
    }

    /// Number of triangles of the mesh itself, where a polygon of n corners counts as n - 2.
    pub fn base_triangles(&self) -> usize {
        self.base.triangles.len()
    }

    /// Number of triangles, likewise.
    pub fn triangles(&self) -> usize {
        self.pieces().list.len()
    }

    /// The vertices of the mesh that each vertex after those of the mesh is interpolated from.
    pub fn new_vertices(&self) -> impl ExactSizeIterator<Item = Source> {
        self.pieces().vertices.iter().map(|new| new.source)
    }

    /// The original UV of a UV point, with the tile's offset.
    pub fn uv(&self, uv_point: u32) -> [f64; 2] {
        self.pieces().uv_points[uv_point as usize].uv
    }

    /// The redirected UVs of all UV points.
    pub fn redirected(&self, team: &Team, results: &Redirections) -> Vec<[f64; 2]> {
        let points = &self.pieces().uv_points;
        let mut uvs = zeroed(points.len());
        results.redirect(team, points, &mut uvs);
        uvs
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.pieces().bytes() + self.base.bytes()
    }

    /// Calls `face(face of the mesh, corners)` for each face, and then `corner` for each of its corners.
    pub fn visit(&self, mesh: &Mesh, mut face: impl FnMut(u32, u32), mut corner: impl FnMut(&RefinedCorner)) {
        let base = &*self.base;
        let mut rest = &*self.pieces().list;
        for (f, &whole) in self.pieces().whole.iter().enumerate() {
            let is_of = |base_triangle: u32| base.triangles[base_triangle as usize].face as usize == f;
            let count = rest.iter().take_while(|piece| is_of(piece.base)).count();
            let (own, others) = rest.split_at(count);
            rest = others;
            if whole {
                let corners = mesh.face(f);
                face(f as u32, corners.len() as u32);
                for c in corners {
                    let (vertex, uv_point) = (mesh.indices[c], base.uv_point[c]);
                    corner(&RefinedCorner { vertex, uv_point, source: Source::one(c as u32) });
                }
                continue;
            }
            for piece in own {
                face(f as u32, 3);
                let of = base.triangles[piece.base as usize].corners;
                for PieceCorner { vertex, uv_point, weights } in piece.corners {
                    corner(&RefinedCorner { vertex, uv_point, source: Source::weighed(of, weights) });
                }
            }
        }
    }
}
