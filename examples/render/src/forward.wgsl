// Everything in one pass: a lookup for each fragment of the mesh.

@fragment
fn forward(p: Pixel) -> @location(0) vec4f {
    let uv = redirected(p.uv, p.layer);
    // Features are squeezed and stretched by the map, so the footprint in the texture must come from the redirected UV.
    // The fine derivatives are exact for each pixel; plain dpdx and dpdy work as well.
    return lit(p.normal, uv, dpdxFine(uv), dpdyFine(uv), p.layer);
}
