//! Describes a refined mesh in terms of the original mesh.

use vrtm_core::error::Result;

use super::Refinement;
use super::split::{PieceCorner, Source};

/// Destination of a refinement's pattern; fields that are `None` are skipped. A host uses the pattern to interpolate
/// positions and all other attributes of its vertices and corners.
///
/// Sources have weights that add up to 1. A vertex or corner that needs fewer than three has weight 0 for the rest, which
/// repeat the first.
#[derive(Debug, Default)]
pub struct RefinementPattern<'a> {
    /// Per vertex, up to three vertices of the mesh. The mesh's own vertices come first, in their order, each with itself
    /// as its source.
    pub vertex_sources: Option<&'a mut [[u32; 3]]>,
    /// Per vertex, the weights of its sources.
    pub vertex_weights: Option<&'a mut [[f32; 3]]>,
    /// Per face, the face of the mesh that contains it. They are in the order of the mesh's faces.
    pub face_sources: Option<&'a mut [u32]>,
    /// Per face, its number of corners: 3 for a part of a face; an unsplit face keeps its own number.
    pub face_counts: Option<&'a mut [u32]>,
    /// Per corner, its vertex.
    pub corner_vertices: Option<&'a mut [u32]>,
    /// Per corner, up to three corners of the mesh, from the triangle of the face that contains it.
    pub corner_sources: Option<&'a mut [[u32; 3]]>,
    /// Per corner, the weights of its sources.
    pub corner_weights: Option<&'a mut [[f32; 3]]>,
    /// Per corner, its original UV in the set, with the tile's offset, interpolated from its sources.
    pub corner_uvs: Option<&'a mut [[f32; 2]]>,
}

/// A corner of the refined mesh.
pub(super) struct RefinedCorner {
    pub vertex: u32,
    pub uv_point: u32,
    /// Corners of the mesh.
    pub source: Source,
}

impl Refinement {
    /// Calls `face(face of the mesh, corners)` for each face, and then `corner` for each of its corners.
    pub(super) fn visit(&self, mut face: impl FnMut(u32, u32), mut corner: impl FnMut(&RefinedCorner)) {
        let (mesh, base) = (self.results.mesh(), &*self.base);
        let mut rest = &*self.pieces.list;
        for (f, &whole) in self.pieces.whole.iter().enumerate() {
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

    /// Writes the pattern.
    ///
    /// # Errors
    /// `InvalidArgument`, naming the array, if its length differs from [`Refinement::info`]; nothing is written then.
    pub fn pattern(&self, pattern: &mut RefinementPattern) -> Result<()> {
        let info = self.info();
        let check = |name, given: Option<usize>, needed, of| {
            given.map_or(Ok(()), |given| self.check(name, given, needed, of))
        };
        macro_rules! sizes {
            ($($field:ident: $of:ident),+) => {
                $(check(
                    stringify!($field),
                    pattern.$field.as_ref().map(|array| array.len()),
                    info.$of,
                    stringify!($of),
                )?;)+
            };
        }
        sizes!(
            vertex_sources: vertices,
            vertex_weights: vertices,
            face_sources: faces,
            face_counts: faces,
            corner_vertices: corners,
            corner_sources: corners,
            corner_weights: corners,
            corner_uvs: corners
        );
        let old = self.results.mesh().rest.len() as u32;
        let sources = || (0..old).map(Source::one).chain(self.pieces.vertices.iter().map(|new| new.source));
        write(&mut pattern.vertex_sources, sources().map(|source| source.of));
        write(&mut pattern.vertex_weights, sources().map(|source| source.weights));
        let mut put_face = next(&mut pattern.face_sources);
        let mut put_count = next(&mut pattern.face_counts);
        let mut put_vertex = next(&mut pattern.corner_vertices);
        let mut put_source = next(&mut pattern.corner_sources);
        let mut put_weights = next(&mut pattern.corner_weights);
        let mut put_uv = next(&mut pattern.corner_uvs);
        self.visit(
            |face, count| {
                put_face(face);
                put_count(count);
            },
            |corner| {
                put_vertex(corner.vertex);
                put_source(corner.source.of);
                put_weights(corner.source.weights);
                put_uv(self.pieces.uv_points[corner.uv_point as usize].uv.map(|x| x as f32));
            },
        );
        Ok(())
    }
}

fn write<T>(array: &mut Option<&mut [T]>, values: impl Iterator<Item = T>) {
    let mut put = next(array);
    values.for_each(&mut put);
}

/// Returns a function that writes the elements of an array in order.
fn next<'a, T>(array: &'a mut Option<&mut [T]>) -> impl FnMut(T) + 'a {
    let mut elements = array.as_deref_mut().unwrap_or_default().iter_mut();
    move |value| {
        if let Some(element) = elements.next() {
            *element = value;
        }
    }
}
