// Converts the content of the map to the UV at which to sample the texture. The map stores that UV within the tile, or
// its difference from the surface's own UV.

override DELTA: bool = false;

fn redirected(uv: vec2f, layer: u32) -> vec2f {
    return stored(uv, layer) + select(vec2f(0.0), uv, DELTA);
}
