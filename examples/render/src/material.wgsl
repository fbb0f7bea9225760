// The lit colour of the surface at an already redirected UV.

// Whether the texture is read with explicit derivatives. Without them, the sampler uses the derivatives of the UV,
// which is already redirected: the same picture, but only where neighbours on the screen are the same surface and take
// the same branches, as in a forward pass.
override EXPLICIT: bool = true;
override NORMALS: bool = false;

@group(1) @binding(0) var albedo: texture_2d_array<f32>;
@group(1) @binding(1) var normals: texture_2d_array<f32>;
// Linear within and between mip levels, anisotropic.
@group(1) @binding(2) var texture_sampler: sampler;

// The normal from a tangent-space normal map. Its x and y point along the painted texture's u and v, and these turn
// with the features that were painted: so the tangents come from the derivatives of the redirected UV, by x and by y on
// the screen, and not from the mesh. (P by x, P by y) = (P by u, P by v) * (uv by x, uv by y), solved for P by u and P
// by v.
fn mapped_normal(n: vec3f, uv: vec2f, by_x: vec2f, by_y: vec2f, layer: u32) -> vec3f {
    // The step on the tangent plane for one pixel, with an orthographic camera.
    let facing = max(dot(n, view.toward.xyz), 0.05);
    let p_x = view.right.xyz - view.toward.xyz * (dot(n, view.right.xyz) / facing);
    let p_y = view.down.xyz - view.toward.xyz * (dot(n, view.down.xyz) / facing);
    let turned = by_x.x * by_y.y - by_x.y * by_y.x;
    // Only directions matter, so there is no division by the determinant, which may be tiny.
    let p_u = (p_x * by_y.y - p_y * by_x.y) * sign(turned);
    let p_v = (p_y * by_x.x - p_x * by_y.x) * sign(turned);
    let m = textureSampleGrad(normals, texture_sampler, uv, layer, by_x, by_y).xyz * 2.0 - 1.0;
    let tangents = normalize(p_u + vec3f(1e-30)) * m.x + normalize(p_v + vec3f(1e-30)) * m.y;
    return normalize(tangents + n * m.z);
}

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
    if NORMALS {
        n = mapped_normal(n, uv, by_x, by_y, layer);
    }
    let to_light = normalize(view.toward.xyz - 0.6 * view.right.xyz - 0.7 * view.down.xyz);
    let diffuse = max(dot(n, to_light), 0.0);
    let shine = pow(max(dot(n, normalize(to_light + view.toward.xyz)), 0.0), 40.0);
    return vec4f(colour * (0.18 + 0.82 * diffuse) + 0.12 * shine, 1.0);
}
