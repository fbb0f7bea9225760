// The redirection map, filtered by the sampler: rg16float on all devices, rg32float on those with `float32-filterable`.
// Always read level 0: coarser levels would average redirections of distant places, which leaves studs ragged.

@group(2) @binding(0) var map: texture_2d_array<f32>;
// Linear, clamped to the edge: with `repeat`, a chart that touches an edge would read texels from the opposite edge.
@group(2) @binding(1) var map_sampler: sampler;

fn stored(uv: vec2f, layer: u32) -> vec2f {
    return textureSampleLevel(map, map_sampler, uv, layer, 0.0).rg;
}
