// The surface: a material that is computed from the rigidity map, so that a stroke of the brush uploads nothing else;
// strain as colour; and the lines of the warped grid. `redirected` comes from examples/render.

struct View {
    clip: mat4x4f,
    eye: vec4f,
    // Unit vectors to the right and up on the screen.
    right: vec4f,
    up: vec4f,
    // 1 = look the texture up through the redirection, 0 = by the original UVs.
    redirect: f32,
    // What is shown: 0 = the material, 1 = the rigidity map, 2 = strain.
    shown: f32,
    // Lines of the grid per tile; 0 = none. Their width in pixels.
    lines: f32,
    line_width: f32,
    // The strain at the ends of the colours.
    range: f32,
    // Strength of the rigidity map over textures, 0..1.
    overlay: f32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> positions: array<f32>;
@group(0) @binding(2) var<storage, read> normals: array<f32>;
@group(0) @binding(3) var<storage, read> rest: array<f32>;

@group(1) @binding(0) var rigidity: texture_2d<f32>;
// Squared lengths of steps in u and v at rest, and their product: what a texel of the texture measures.
@group(1) @binding(1) var metric: texture_2d<f32>;
@group(1) @binding(2) var rigidity_sampler: sampler;
// The tile's own texture; a single texel if it has none.
@group(1) @binding(3) var paint: texture_2d<f32>;
// Its normal map in tangent space; a single texel if it has none.
@group(1) @binding(4) var bumps: texture_2d<f32>;
// Where seams continue: beside charts, where in its tile the content of a texel is, of 65535; 0 = at its own place.
@group(1) @binding(5) var places: texture_2d<u32>;

struct Pixel {
    @builtin(position) at: vec4f,
    @location(0) position: vec3f,
    @location(1) rest: vec3f,
    @location(2) normal: vec3f,
    @location(3) uv: vec2f,
}

fn corner_of(vertex: u32, uv: vec2f) -> Pixel {
    let k = 3u * vertex;
    let position = vec3f(positions[k], positions[k + 1u], positions[k + 2u]);
    let normal = vec3f(normals[k], normals[k + 1u], normals[k + 2u]);
    let at_rest = vec3f(rest[k], rest[k + 1u], rest[k + 2u]);
    return Pixel(view.clip * vec4f(position, 1.0), position, at_rest, normal, uv);
}

@vertex
fn corner(@location(0) vertex: u32, @location(1) uv: vec2f) -> Pixel {
    return corner_of(vertex, uv);
}

// The texture plane of the tile, to store the metric at rest.
@vertex
fn flat_corner(@location(0) vertex: u32, @location(1) uv: vec2f) -> Pixel {
    var pixel = corner_of(vertex, uv);
    pixel.at = vec4f(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y, 0.5, 1.0);
    return pixel;
}

@fragment
fn rest_metric(p: Pixel) -> @location(0) vec4f {
    let side = view.range;
    let by_u = dpdx(p.rest) * side;
    let by_v = dpdy(p.rest) * side;
    return vec4f(dot(by_u, by_u), dot(by_u, by_v), dot(by_v, by_v), 1.0);
}

// The rigidity map, smoothed by a cubic B-spline: the outlines of an 8-bit mask would otherwise be staircases. Its
// value, and its derivatives by u and v, from texels themselves: a sampler's weights are too coarse for derivatives.
fn rigid(uv: vec2f) -> vec3f {
    let size = textureDimensions(rigidity);
    let at = uv * vec2f(size) - 0.5;
    let f = fract(at);
    let low = vec2i(floor(at));
    let last = vec2i(size) - 1;
    let x = spline(f.x);
    let y = spline(f.y);
    let by_x = spline_slope(f.x);
    let by_y = spline_slope(f.y);
    var sum = vec3f(0.0);
    for (var j = 0; j < 4; j++) {
        var row: vec4f;
        for (var i = 0; i < 4; i++) {
            row[i] = textureLoad(rigidity, clamp(low + vec2i(i, j) - 1, vec2i(0), last), 0).r;
        }
        let across = dot(x, row);
        sum += vec3f(across * y[j], dot(by_x, row) * y[j], across * by_y[j]);
    }
    return sum * vec3f(1.0, vec2f(size));
}

fn spline(t: f32) -> vec4f {
    let s = 1.0 - t;
    let a = s * s * s / 6.0;
    let b = (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0;
    let d = t * t * t / 6.0;
    return vec4f(a, b, 1.0 - a - b - d, d);
}

fn spline_slope(t: f32) -> vec4f {
    let s = 1.0 - t;
    return vec4f(-0.5 * s * s, 1.5 * t * t - 2.0 * t, 0.5 + t - 1.5 * t * t, 0.5 * t * t);
}

// The part of a pixel in every other square of a checker, filtered by the pixel's footprint.
fn checker(p: vec2f, width: vec2f) -> f32 {
    let w = max(width, vec2f(1e-5));
    let wave = 2.0 * (abs(fract((p - 0.5 * w) / 2.0) - 0.5) - abs(fract((p + 0.5 * w) / 2.0) - 0.5)) / w;
    return 0.5 - 0.5 * wave.x * wave.y;
}

// How much of a pixel lines at whole numbers cover: `width` in pixels; they fade out where they come too close.
fn lines(p: vec2f, footprint: vec2f, width: f32) -> f32 {
    let pixels = abs(fract(p - 0.5) - 0.5) / max(footprint, vec2f(1e-6));
    let line = vec2f(1.0) - smoothstep(vec2f(0.5 * width - 0.5), vec2f(0.5 * width + 0.5), pixels);
    let fade = vec2f(1.0) - smoothstep(vec2f(0.15), vec2f(0.4), footprint);
    return max(line.x * fade.x, line.y * fade.y);
}

struct Lookup {
    uv: vec2f,
    by_x: vec2f,
    by_y: vec2f,
}

// Where the texture is looked up, and how that changes by pixel.
fn lookup(p: Pixel) -> Lookup {
    let by_x = dpdxFine(p.uv);
    let by_y = dpdyFine(p.uv);
    if view.redirect == 0.0 {
        return Lookup(p.uv, by_x, by_y);
    }
    // Differences over a texel of the map are smooth where the derivative of its interpolation has steps.
    let h = 0.5 / vec2f(textureDimensions(map));
    let u = vec2f(h.x, 0.0);
    let v = vec2f(0.0, h.y);
    let by_u = (redirected(p.uv + u, 0u) - redirected(p.uv - u, 0u)) / (2.0 * h.x);
    let by_v = (redirected(p.uv + v, 0u) - redirected(p.uv - v, 0u)) / (2.0 * h.y);
    return Lookup(redirected(p.uv, 0u), by_u * by_x.x + by_v * by_x.y, by_u * by_y.x + by_v * by_y.y);
}

// Where the content of a UV is: beyond a seam, on its other side.
fn content(uv: vec2f) -> vec2f {
    let size = textureDimensions(places);
    let texel = clamp(vec2i(uv * vec2f(size)), vec2i(0), vec2i(size) - 1);
    let place = textureLoad(places, texel, 0).rg;
    return select(vec2f(place) / 65535.0, uv, all(place == vec2u(0u)));
}

// The normal that a normal map gives. Its frame is that in which the texture is seen, through the redirection: the
// bumps of a stud that keeps its shape are lit as at rest.
fn bumped(n: vec3f, at: Lookup, px: vec3f, py: vec3f) -> vec3f {
    let stored = textureSampleGrad(bumps, rigidity_sampler, at.uv, at.by_x, at.by_y).rgb;
    let m = (stored * 255.0 - 127.5) / 127.5;
    let det = at.by_x.x * at.by_y.y - at.by_x.y * at.by_y.x;
    let u = sign(det) * (px * at.by_y.y - py * at.by_x.y);
    let v = sign(det) * (py * at.by_x.x - px * at.by_y.x);
    let t = normalize(u - dot(u, n) * n);
    let b = normalize(v - dot(v, n) * n);
    return normalize(m.x * t + m.y * b + max(m.z, 0.05) * n);
}

// The metric at rest, interpolated between the centres of texels that a chart covers; w is 0 where none of the four
// is one.
fn metric_at(uv: vec2f) -> vec4f {
    let size = textureDimensions(metric);
    let at = uv * vec2f(size) - 0.5;
    let f = fract(at);
    var sum = vec4f(0.0);
    for (var k = 0; k < 4; k++) {
        let d = vec2i(k & 1, k >> 1);
        let texel = clamp(vec2i(floor(at)) + d, vec2i(0), vec2i(size) - 1);
        let share = mix(1.0 - f, f, vec2f(d));
        sum += share.x * share.y * textureLoad(metric, texel, 0);
    }
    // Texels that no chart covers are 0 throughout.
    return sum / max(sum.w, 1e-6) * step(1e-6, sum.w);
}

// The relative change of length that is largest in size: the pose against rest, both along steps on the screen.
fn strain(p: Pixel, at: Lookup) -> f32 {
    let scale = 1.0 / length(dpdx(p.position));
    let px = dpdx(p.position) * scale;
    let py = dpdy(p.position) * scale;
    let pose = vec3f(dot(px, px), dot(px, py), dot(py, py));
    let m = metric_at(at.uv);
    let dx = at.by_x * scale;
    let dy = at.by_y * scale;
    let mx = vec2f(m.x * dx.x + m.y * dx.y, m.y * dx.x + m.z * dx.y);
    var r = vec3f(dot(mx, dx), dot(mx, dy), m.x * dy.x * dy.x + 2.0 * m.y * dy.x * dy.y + m.z * dy.y * dy.y);
    if m.w == 0.0 || view.redirect == 0.0 {
        // The surface's own place at rest: exact for the original UVs, and a stand-in at texels beside the charts.
        let rx = dpdx(p.rest) * scale;
        let ry = dpdy(p.rest) * scale;
        r = vec3f(dot(rx, rx), dot(rx, ry), dot(ry, ry));
    }
    let det_pose = pose.x * pose.z - pose.y * pose.y;
    let det_rest = r.x * r.z - r.y * r.y;
    let half = (r.z * pose.x - 2.0 * r.y * pose.y + r.x * pose.z) / (2.0 * det_rest);
    let root = sqrt(max(half * half - det_pose / det_rest, 0.0));
    let stretch = sqrt(max(half + root, 0.0)) - 1.0;
    let squeeze = sqrt(max(half - root, 0.0)) - 1.0;
    return select(squeeze, stretch, stretch > -squeeze);
}

// Blue = squeezed, red = stretched. The legend of the window has the same colours.
fn strain_colour(s: f32) -> vec3f {
    let t = clamp(s / view.range, -1.0, 1.0);
    let still = vec3f(0.60, 0.58, 0.54);
    let end = select(vec3f(0.03, 0.16, 0.75), vec3f(0.80, 0.05, 0.03), t > 0.0);
    return mix(still, end, pow(abs(t), 0.8));
}

@fragment
fn surface(p: Pixel) -> @location(0) vec4f {
    let at = lookup(p);
    let size = vec2f(textureDimensions(rigidity));
    let footprint = vec2f(length(vec2f(at.by_x.x, at.by_y.x)), length(vec2f(at.by_x.y, at.by_y.y)));
    let texels = max(footprint.x * size.x, footprint.y * size.y);
    // Where a texel is smaller than a pixel, coarser levels take over, for which the sampler's weights are fine
    // enough. Texels of several levels must not be loaded one beside the other: software drivers read all of them at
    // one level.
    let lod = log2(max(texels, 1e-3));
    let far = smoothstep(0.0, 1.0, lod);
    let near_map = rigid(at.uv);
    let far_map = textureSampleLevel(rigidity, rigidity_sampler, at.uv, max(lod, 0.0)).r;
    let r = mix(near_map.x, far_map, far);
    // How the map changes by pixel.
    let near_slope = vec2f(dot(near_map.yz, at.by_x), dot(near_map.yz, at.by_y));
    let by_pixel = mix(near_slope, vec2f(dpdxFine(far_map), dpdyFine(far_map)), far);
    let edge = max(length(by_pixel), 1e-4);
    let stud = clamp((r - 0.5) / edge + 0.5, 0.0, 1.0);

    let toward = normalize(view.eye.xyz - p.position);
    var n = normalize(p.normal);
    // The side of the face that is seen: near an outline n itself may point away.
    let face = cross(dpdx(p.position), dpdy(p.position));
    n = select(n, -n, dot(n, face) * dot(face, toward) < 0.0);
    // Vertices that are one have one normal: edges that it misses by far are hard.
    let plane = normalize(face) * sign(dot(face, n));
    n = normalize(mix(plane, n, smoothstep(0.5, 0.8, dot(plane, n))));
    let skin = n;
    var colour = vec3f(0.0);
    var shine = 0.10;
    var alpha = 1.0;
    if textureDimensions(paint).x > 1u {
        let texel = textureSampleGrad(paint, rigidity_sampler, at.uv, at.by_x, at.by_y);
        colour = texel.rgb;
        alpha = texel.a;
    }
    if view.shown == 1.0 {
        colour = mix(vec3f(0.035, 0.05, 0.075), vec3f(0.92, 0.90, 0.86), clamp(r, 0.0, 1.0));
    } else if view.shown == 2.0 {
        let inside = strain_colour(strain(p, at));
        colour = mix(vec3f(0.055, 0.06, 0.07), inside, stud);
        shine = 0.03;
    } else if textureDimensions(paint).x > 1u {
        let outline = 1.0 - smoothstep(0.5, 1.5, abs(r - 0.5) / edge);
        colour = mix(colour, vec3f(0.02, 0.55, 0.60), 0.55 * view.overlay * clamp(r, 0.0, 1.0));
        colour = mix(colour, vec3f(0.80, 0.95, 0.95), view.overlay * outline);
    } else {
        // Colours vary over the tile, so that no two places look alike.
        let own = content(at.uv);
        let part = 0.5 + 0.5 * cos(6.3 * (dot(own, vec2f(1.3, 0.9)) + vec3f(0.0, 0.33, 0.67)));
        let squares = checker(own * 32.0, footprint * 32.0);
        colour = mix(0.13, 0.30, squares) * mix(vec3f(0.42, 0.62, 0.66), part, 0.32);
        let crossed = lines(own * 128.0, footprint * 128.0, max(1.0, 0.12 / max(footprint.x * 128.0, 1e-4)));
        let metal = mix(vec3f(0.84, 0.56, 0.22), vec3f(0.34, 0.15, 0.05), 0.7 * crossed);
        colour = mix(colour, metal, stud);
        // A dark outline, one and a half texels of the map wide and never under a pixel.
        let outline = abs(r - 0.5) / edge;
        let half = max(0.75 / max(texels, 1e-3), 0.7);
        colour = mix(vec3f(0.012, 0.009, 0.008), colour, smoothstep(half - 0.6, half + 0.6, outline));
        shine = mix(0.06, 0.35, stud);
        // Studs are raised: the gradient of a height over the surface, from its change by pixel. It fades where a
        // texel is smaller than a pixel.
        let px = dpdx(p.position);
        let py = dpdy(p.position);
        let a = cross(py, n);
        let b = cross(n, px);
        let det = dot(px, a);
        let texel = length(px) / max(texels, 1e-4);
        let height = 2.2 * texel * min(1.0, 1.0 / max(texels, 1e-3));
        let bump = sign(det) * (by_pixel.x * a + by_pixel.y * b) * height;
        n = normalize(abs(det) * n - bump);
    }
    if view.shown == 0.0 && textureDimensions(bumps).x > 1u {
        n = bumped(skin, at, dpdx(p.position), dpdy(p.position));
    }
    if view.lines > 0.0 {
        let on = lines(at.uv * view.lines, footprint * view.lines, view.line_width);
        colour = mix(colour, vec3f(0.72, 0.86, 0.90), 0.85 * on);
    }
    return vec4f(lit(colour, shine, n, toward), alpha);
}

// A light over the viewer's left shoulder, and a sky.
fn lit(colour: vec3f, shine: f32, n: vec3f, toward: vec3f) -> vec3f {
    let to_light = normalize(toward + 0.75 * view.up.xyz - 0.55 * view.right.xyz);
    let wrapped = 0.5 * dot(n, to_light) + 0.5;
    let sky = 0.5 + 0.5 * dot(n, view.up.xyz);
    let diffuse = 0.86 * wrapped * wrapped + 0.20 * sky + 0.06;
    let half_way = normalize(to_light + toward);
    let rim = pow(1.0 - max(dot(n, toward), 0.0), 4.0);
    return colour * diffuse + shine * (pow(max(dot(n, half_way), 0.0), 48.0) + 0.35 * rim * sky);
}
