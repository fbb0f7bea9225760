// A triangle of a tile, for the stages that look at the surface.

/// UVs of a triangle and its pose. Offsets from its first corner, in cells.
struct Triangle {
    corner: array<f32, 2>,
    /// Rows of the matrix that takes an offset to the barycentrics of corners 1 and 2.
    barycentric: array<f32, 4>,
    /// Across the edge opposite to each corner, or NONE.
    neighbours: array<u32, 3>,
    chart: u32,
    /// Position at the first corner, df/dx, df/dy.
    pose: array<f32, 9>,
}

@group(0) @binding(6) var<storage, read_write> triangles: array<Triangle>;
