// A triangle of a tile, for the stages that look at the surface.

@group(0) @binding(6) var<storage, read_write> triangles: array<Triangle>;
