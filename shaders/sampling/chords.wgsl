// The surface of the finest level: exact positions and tangents on the triangle under W(p), found by walking
// (method §2). The length of an edge is the chord between its ends.

struct Sample {
    found: bool,
    value: vec3f,
    slope_x: vec3f,
    slope_y: vec3f,
    triangle: u32,
}

/// Offset of node (i, j) + u from a triangle's corner.
fn from_corner(t: u32, node: vec2i, u: vec2f) -> vec2f {
    return (vec2f(node) - vec2f(triangles[t].corner[0], triangles[t].corner[1])) + u;
}

fn barycentrics(t: u32, node: vec2i, u: vec2f) -> vec3f {
    let d = from_corner(t, node, u);
    let l1 = triangles[t].barycentric[0] * d.x + triangles[t].barycentric[1] * d.y;
    let l2 = triangles[t].barycentric[2] * d.x + triangles[t].barycentric[3] * d.y;
    return vec3f(1.0 - l1 - l2, l1, l2);
}

/// The triangle under a node's displaced place, by walking from `start`; NONE at a border or after too many steps.
fn locate(node: vec2i, u: vec2f, start: u32) -> u32 {
    var t = start;
    for (var step = 0u; step < WALK_STEPS; step++) {
        let l = barycentrics(t, node, u);
        var low = l.x;
        var corner = 0u;
        if l.y < low {
            low = l.y;
            corner = 1u;
        }
        if l.z < low {
            low = l.z;
            corner = 2u;
        }
        if low >= -INSIDE_TOLERANCE {
            return t;
        }
        var next = triangles[t].neighbours[corner];
        if next == NONE {
            // On the border: the other negative corner, if there is one; rounding may put a point just outside.
            for (var k = 0u; k < 3u && next == NONE; k++) {
                let other = select(select(l.x, l.y, k == 1u), l.z, k == 2u);
                if k != corner && other < -INSIDE_TOLERANCE {
                    next = triangles[t].neighbours[k];
                }
            }
            if next == NONE {
                return select(NONE, t, low >= -BORDER_TOLERANCE);
            }
        }
        t = next;
    }
    return NONE;
}

/// The sample on triangle t, extrapolated if the point lies outside.
fn on(t: u32, node: vec2i, u: vec2f) -> Sample {
    let d = from_corner(t, node, u);
    let p = triangles[t].pose;
    let x = vec3f(p[3], p[4], p[5]);
    let y = vec3f(p[6], p[7], p[8]);
    return Sample(true, vec3f(p[0], p[1], p[2]) + (x * d.x + y * d.y), x, y, t);
}

/// Triangle under a node at rest.
fn under(b: u32, s: u32) -> u32 {
    return nodes[node_at(b, UNDER, s)];
}

/// Triangle under the node nearest to W(p), if it belongs to the block's chart.
fn nearest(b: u32, node: vec2i, u: vec2f) -> u32 {
    let at = node + vec2i(round(u));
    let holder = holding(b, at.x, at.y);
    if holder == NONE {
        return NONE;
    }
    let t = under(holder, slot(u32(at.x & 15), u32(at.y & 15)));
    if t == NONE || triangles[t].chart != blocks[b].chart {
        return NONE;
    }
    return t;
}

/// The surface at node + u of block b's chart, by walking from triangle `start`.
fn sample_surface(b: u32, node: vec2i, u: vec2f, start: u32) -> Sample {
    var t = locate(node, u, start);
    if t == NONE {
        // The walk was stopped by a border or ran too far: begin at the node nearest to W(p).
        let near = nearest(b, node, u);
        if near != NONE && near != start {
            t = locate(node, u, near);
        }
    }
    if t == NONE {
        return Sample(false, vec3f(), vec3f(), vec3f(), NONE);
    }
    return on(t, node, u);
}

/// Slopes where the state is known to be good: of df/dx, then df/dy.
fn slopes(b: u32, node: vec2i, u: vec2f, t: u32) -> mat2x3f {
    if t == NONE {
        return mat2x3f(vec3f(), vec3f());
    }
    let p = triangles[t].pose;
    return mat2x3f(vec3f(p[3], p[4], p[5]), vec3f(p[6], p[7], p[8]));
}

/// The sample of a node as it is set from outside.
fn refreshed(b: u32, node: vec2i, s: u32, u: vec2f, fixed: bool) -> Sample {
    let rest = under(b, s);
    if rest == NONE {
        return Sample(true, vec3f(), vec3f(), vec3f(), NONE);
    }
    if fixed {
        return on(rest, node, vec2f());
    }
    // The node nearest to W(p) is a better start than p.
    let near = nearest(b, node, u);
    let start = select(rest, near, near != NONE);
    let sample = sample_surface(b, node, u, start);
    if sample.found {
        return sample;
    }
    return on(start, node, u);
}

/// What the gradients at both ends of an edge share: the chord, 1 / L and d.
struct Chord {
    along: vec3f,
    d: vec2f,
    length: f32,
    inverse: f32,
}

/// The chord from p to n: from the triangle's tangents where both ends lie on one, the difference of positions
/// elsewhere.
fn chord(value: vec3f, slope: mat2x3f, other: vec3f, same: bool, d: vec2f) -> Chord {
    let along = select(other - value, slope[0] * d.x + slope[1] * d.y, same);
    let length = sqrt(dot(along, along) + TINY);
    return Chord(along, d, length, 1.0 / length);
}

/// dL/du at the near end.
fn near_gradient(c: Chord, slope: mat2x3f) -> vec2f {
    return -far_gradient(c, slope);
}

/// dL/du at the far end.
fn far_gradient(c: Chord, slope: mat2x3f) -> vec2f {
    return vec2f(dot(slope[0], c.along), dot(slope[1], c.along)) * c.inverse;
}
