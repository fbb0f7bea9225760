//! The charts of the mesh: triangles that hang together in the UV plane.

use crate::mesh::Triangle;

/// The chart of each triangle, as the number of one of its triangles: those that share UVs belong together.
pub fn islands(triangles: &[Triangle]) -> Vec<u32> {
    let corners = triangles.iter().flat_map(|t| t.corners).max().map_or(0, |most| most as usize + 1);
    let mut of: Vec<u32> = (0..triangles.len() as u32).collect();
    let mut at_corner = vec![None; corners];
    for (k, triangle) in (0..).zip(triangles) {
        for corner in triangle.corners {
            match at_corner[corner as usize] {
                Some(other) => join(&mut of, k, other),
                None => at_corner[corner as usize] = Some(k),
            }
        }
    }
    (0..of.len() as u32).map(|k| root(&mut of, k)).collect()
}

fn root(of: &mut [u32], mut k: u32) -> u32 {
    while of[k as usize] != k {
        let next = of[of[k as usize] as usize];
        of[k as usize] = next;
        k = next;
    }
    k
}

fn join(of: &mut [u32], a: u32, b: u32) {
    let [a, b] = [root(of, a), root(of, b)];
    of[a.max(b) as usize] = a.min(b);
}
