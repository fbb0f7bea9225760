//! Describes a refined mesh in terms of the original mesh.

use vrtm_core::error::Result;

use super::Refinement;
use vrtm_refine::Source;

/// Destination of a refinement's pattern; fields that are `None` are skipped. A host uses the pattern to interpolate
/// positions and all other attributes of its vertices and corners.
///
/// Sources have weights that add up to 1. A vertex or corner that needs fewer than three has weight 0 for the rest,
/// which repeat the first.
#[derive(Debug, Default)]
pub struct RefinementPattern<'a> {
    /// Per vertex, up to three vertices of the mesh. The mesh's own vertices come first, in their order, each with
    /// itself as its source.
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

impl Refinement {
    /// Writes the pattern.
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
        let sources = || (0..old).map(Source::one).chain(self.mesh.new_vertices());
        write(&mut pattern.vertex_sources, sources().map(|source| source.of));
        write(&mut pattern.vertex_weights, sources().map(|source| source.weights));
        let mut put_face = next(&mut pattern.face_sources);
        let mut put_count = next(&mut pattern.face_counts);
        let mut put_vertex = next(&mut pattern.corner_vertices);
        let mut put_source = next(&mut pattern.corner_sources);
        let mut put_weights = next(&mut pattern.corner_weights);
        let mut put_uv = next(&mut pattern.corner_uvs);
        self.mesh.visit(
            self.results.mesh(),
            |face, count| {
                put_face(face);
                put_count(count);
            },
            |corner| {
                put_vertex(corner.vertex);
                put_source(corner.source.of);
                put_weights(corner.source.weights);
                put_uv(self.mesh.uv(corner.uv_point).map(|x| x as f32));
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
