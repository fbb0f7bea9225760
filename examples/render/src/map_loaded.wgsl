// The redirection map, interpolated by hand: for rg32float without `float32-filterable`.

@group(2) @binding(0) var map: texture_2d_array<f32>;

fn stored(uv: vec2f, layer: u32) -> vec2f {
    let last = vec2i(textureDimensions(map)) - 1;
    // Texel (0, 0) has its centre at (0.5, 0.5).
    let at = uv * vec2f(textureDimensions(map)) - 0.5;
    let low = vec2i(floor(at));
    let a = clamp(low, vec2i(0), last);
    let b = clamp(low + 1, vec2i(0), last);
    let t = at - floor(at);
    let bottom = mix(textureLoad(map, a, layer, 0), textureLoad(map, vec2i(b.x, a.y), layer, 0), t.x);
    let top = mix(textureLoad(map, vec2i(a.x, b.y), layer, 0), textureLoad(map, b, layer, 0), t.x);
    return mix(bottom, top, t.y).rg;
}
