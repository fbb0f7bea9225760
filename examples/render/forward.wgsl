// Everything in one pass: a lookup for each fragment of the mesh.

@fragment
fn forward(p: Pixel) -> @location(0) vec4f {
    let uv = redirected(p.uv, p.layer);
    // Features are squeezed and stretched by the map, so the footprint in the texture is the redirected UV's. The fine
    // derivatives are those of each pixel itself; plain dpdx and dpdy will do as well.
    return lit(p.normal, uv, dpdxFine(uv), dpdyFine(uv), p.layer);
}
