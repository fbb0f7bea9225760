// The UV at which to sample the texture, from what the map stores: that UV within the tile, or its difference from the
// surface's own.

override DELTA: bool = false;

fn redirected(uv: vec2f, layer: u32) -> vec2f {
    return stored(uv, layer) + select(vec2f(0.0), uv, DELTA);
}
