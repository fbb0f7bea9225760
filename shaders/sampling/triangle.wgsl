// The triangles of a tile: constants, and the pose (position and tangents) that the kernel `surface` writes.

@group(0) @binding(6) var<storage, read_write> triangles: array<Triangle>;
