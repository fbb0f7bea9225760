// Deferred shading in two passes: the first stores the original UVs and their derivatives, the second looks up the
// texture for visible pixels only.

struct Surface {
    // rg32float, because 16 bits would be too few for a texture of 4096 texels.
    @location(0) uv: vec2f,
    // rgba16float: the derivatives by x and by y on the screen, in texels of a texture of 1024 texels, because 16-bit
    // floats smaller than 1/16384 lose precision.
    @location(1) by: vec4f,
    // rgba16float: the normal, and 1 + the tile's layer; 0 where no surface is visible.
    @location(2) normal: vec4f,
}

@fragment
fn surface(p: Pixel) -> Surface {
    let by = vec4f(dpdxFine(p.uv), dpdyFine(p.uv));
    return Surface(p.uv, 1024.0 * by, vec4f(normalize(p.normal), f32(p.layer + 1u)));
}

@group(3) @binding(0) var surface_uv: texture_2d<f32>;
@group(3) @binding(1) var surface_by: texture_2d<f32>;
@group(3) @binding(2) var surface_normal: texture_2d<f32>;

// A triangle that covers the screen.
@vertex
fn screen(@builtin(vertex_index) k: u32) -> @builtin(position) vec4f {
    return vec4f(f32(k & 1u) * 4.0 - 1.0, f32(k >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn deferred(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(at.xy);
    let normal = textureLoad(surface_normal, pixel, 0);
    if normal.w == 0.0 {
        discard;
    }
    let layer = u32(max(normal.w, 1.0)) - 1u;
    let uv = textureLoad(surface_uv, pixel, 0).rg;
    let by = textureLoad(surface_by, pixel, 0) / 1024.0;
    let new_uv = redirected(uv, layer);
    // The neighbours on the screen may belong to another surface, so dpdx and dpdy must not be used here. The
    // derivatives of the redirected UV are differences to the continuation of this surface, toward the other column and
    // row of the pixel's block of two by two, exactly as dpdxFine gives in a forward pass.
    let side = vec2f(1.0) - 2.0 * vec2f(pixel & vec2u(1u));
    let by_x = (redirected(uv + side.x * by.xy, layer) - new_uv) * side.x;
    let by_y = (redirected(uv + side.y * by.zw, layer) - new_uv) * side.y;
    return lit(normal.xyz, new_uv, by_x, by_y, layer);
}
