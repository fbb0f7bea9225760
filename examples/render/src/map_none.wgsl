// The original UVs.

fn redirected(uv: vec2f, layer: u32) -> vec2f {
    return uv;
}
