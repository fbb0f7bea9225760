// A mistake to avoid: the redirection map is read like any other texture, through its mip levels.

@group(2) @binding(0) var map: texture_2d_array<f32>;
@group(2) @binding(1) var map_sampler: sampler;

fn stored(uv: vec2f, layer: u32) -> vec2f {
    return textureSample(map, map_sampler, uv, layer).rg;
}
