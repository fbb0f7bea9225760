// The surface on level 1 and above: metrics, interpolated bilinearly between nodes; the length of an edge is its arc
// length (method §3).

/// Per block: the metric (xx, xy, yy) of the pose, in cell units of this level.
@group(0) @binding(6) var<storage, read_write> metric: array<f32>;

struct Sample {
    found: bool,
    value: vec3f,
    triangle: u32,
}

fn metric_at(b: u32, s: u32) -> vec3f {
    let at = b * 3u * NODES + s;
    return vec3f(metric[at], metric[at + NODES], metric[at + 2u * NODES]);
}

fn sample_surface(b: u32, node: vec2i, u: vec2f, start: u32) -> Sample {
    let cell_offset = floor(u);
    let fraction = u - cell_offset;
    let low = node + vec2i(cell_offset);
    var g: array<vec3f, 4>;
    for (var k = 0u; k < 4u; k++) {
        let at = low + vec2i(i32(k & 1u), i32(k >> 1u));
        let holder = block_holding(b, at.x, at.y);
        if holder == NONE {
            return Sample(false, vec3f(), NONE);
        }
        g[k] = metric_at(holder, slot(u32(at.x & 15), u32(at.y & 15)));
    }
    let south = g[0] + fraction.x * (g[1] - g[0]);
    let north = g[2] + fraction.x * (g[3] - g[2]);
    return Sample(true, south + fraction.y * (north - south), NONE);
}

/// True if samples have tangents.
const TANGENTS: bool = false;

fn tangents(t: u32) -> mat2x3f {
    return mat2x3f(vec3f(), vec3f());
}

/// These levels have no triangles.
fn rest_triangle(b: u32, s: u32) -> u32 {
    return NONE;
}

fn find_triangle(b: u32, s: u32, u: vec2f) {}

fn triangle_in_state(b: u32, s: u32, fixed: bool) -> u32 {
    return NONE;
}

fn set_triangle(b: u32, s: u32, t: u32) {}

/// The metric at W of the node at slot s of block b with displacement u. Without a sample, and at fixed nodes, it is
/// the metric at the node itself.
fn value_at(b: u32, s: u32, u: vec2f, t: u32, fixed: bool) -> vec3f {
    if !fixed {
        let sample = sample_surface(b, node_in_level(b, s), u, NONE);
        if sample.found {
            return sample.value;
        }
    }
    return metric_at(b, s);
}

/// For an edge, the product of metric and offset (`along`), d, L and 1 / L, which the gradients at both ends share.
struct Chord {
    along: vec2f,
    d: vec2f,
    length: f32,
    inverse: f32,
}

/// L = sqrt(d' G d), with G the mean of the metrics at both ends.
fn chord(value: vec3f, tangents: mat2x3f, other: vec3f, same: bool, d: vec2f) -> Chord {
    let g = (value + other) * 0.5;
    let along = vec2f(g.x * d.x + g.y * d.y, g.y * d.x + g.z * d.y);
    let length = sqrt(max(dot(along, d), 0.0) + TINY);
    return Chord(along, d, length, 1.0 / length);
}

/// One end's half of the derivative of d' G d that comes from the change of the metric: a quarter of (d' dG/dx d, d'
/// dG/dy d). With the factor 1 / L it is the first term of the gradients in method §3.
fn half_change(c: Chord, slope: mat2x3f) -> vec2f {
    let squares = vec3f(c.d.x * c.d.x, 2.0 * c.d.x * c.d.y, c.d.y * c.d.y);
    return vec2f(dot(slope[0], squares), dot(slope[1], squares)) * 0.25;
}

fn near_gradient(c: Chord, slope: mat2x3f) -> vec2f {
    return (half_change(c, slope) - c.along) * c.inverse;
}

fn far_gradient(c: Chord, slope: mat2x3f) -> vec2f {
    return (half_change(c, slope) + c.along) * c.inverse;
}
