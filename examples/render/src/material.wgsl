// The lit colour of the surface at an already redirected UV.

// Whether the texture is read with explicit derivatives. Without them, the sampler uses the derivatives of the UV,
// which is already redirected: the same picture, but only where neighbours on the screen are the same surface and take
// the same branches, as in a forward pass.
override EXPLICIT: bool = true;

@group(1) @binding(0) var albedo: texture_2d_array<f32>;
// Linear within and between mip levels, anisotropic.
@group(1) @binding(1) var texture_sampler: sampler;

// `by_x` and `by_y` are the derivatives of `uv` by x and y on the screen.
fn lit(normal: vec3f, uv: vec2f, by_x: vec2f, by_y: vec2f, layer: u32) -> vec4f {
    var colour: vec3f;
    if EXPLICIT {
        colour = textureSampleGrad(albedo, texture_sampler, uv, layer, by_x, by_y).rgb;
    } else {
        colour = textureSample(albedo, texture_sampler, uv, layer).rgb;
    }
    // Both sides of the mesh are drawn.
    var n = normalize(normal);
    n = select(n, -n, dot(n, view.toward.xyz) < 0.0);
    let to_light = normalize(view.toward.xyz - 0.6 * view.right.xyz - 0.7 * view.down.xyz);
    let diffuse = max(dot(n, to_light), 0.0);
    let shine = pow(max(dot(n, normalize(to_light + view.toward.xyz)), 0.0), 40.0);
    return vec4f(colour * (0.18 + 0.82 * diffuse) + 0.12 * shine, 1.0);
}
