// The surface on level 0: position and tangents at W on the triangle under W, which is found by walking (method §2).
// The length of an edge is the chord between its ends in space.

struct Sample {
    found: bool,
    value: vec3f,
    triangle: u32,
}

/// Offset of node + u from the first UV corner of triangle t, in cells. The sum is formed in this order so that a small
/// u keeps its digits.
fn from_corner(t: u32, node: vec2i, u: vec2f) -> vec2f {
    return (vec2f(node) - vec2f(triangles[t].corner[0], triangles[t].corner[1])) + u;
}

fn barycentrics(t: u32, node: vec2i, u: vec2f) -> vec3f {
    let d = from_corner(t, node, u);
    let l1 = triangles[t].barycentric[0] * d.x + triangles[t].barycentric[1] * d.y;
    let l2 = triangles[t].barycentric[2] * d.x + triangles[t].barycentric[3] * d.y;
    return vec3f(1.0 - l1 - l2, l1, l2);
}

/// Returns the triangle under node + u, found by walking from triangle `start`; NONE if a border stops the walk or if
/// it takes more than WALK_STEPS steps.
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
            // The edge is a border: cross the edge opposite to another negative coordinate, if there is one. Rounding
            // may put a point just outside of the border.
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

/// The sample at node + u from triangle t, continued affinely if the point lies outside.
fn sample_on_triangle(t: u32, node: vec2i, u: vec2f) -> Sample {
    let d = from_corner(t, node, u);
    let p = triangles[t].pose;
    let x = vec3f(p[3], p[4], p[5]);
    let y = vec3f(p[6], p[7], p[8]);
    return Sample(true, vec3f(p[0], p[1], p[2]) + (x * d.x + y * d.y), t);
}

/// Triangle under the undisplaced node at slot s of block b.
fn rest_triangle(b: u32, s: u32) -> u32 {
    return nodes[node_index(b, TRIANGLE_OR_COVERAGE, s)];
}

/// Returns the triangle under the node nearest to node + u if it belongs to the chart of block b, else NONE.
fn nearest(b: u32, node: vec2i, u: vec2f) -> u32 {
    let at = node + vec2i(round(u));
    let holder = block_holding(b, at.x, at.y);
    if holder == NONE {
        return NONE;
    }
    let t = rest_triangle(holder, slot(u32(at.x & 15), u32(at.y & 15)));
    if t == NONE || triangles[t].chart != blocks[b].chart {
        return NONE;
    }
    return t;
}

/// Returns the triangle of block b's chart under node + u, found by walking from triangle `start`; NONE if no triangle
/// was found.
fn locate_in_chart(b: u32, node: vec2i, u: vec2f, start: u32) -> u32 {
    let t = locate(node, u, start);
    if t == NONE {
        // The walk ended at a border or took too many steps: walk again from the triangle under the node nearest to
        // W(p).
        let nearest_triangle = nearest(b, node, u);
        if nearest_triangle != NONE && nearest_triangle != start {
            return locate(node, u, nearest_triangle);
        }
    }
    return t;
}

/// Samples the surface of block b's chart at node + u, walking from triangle `start`.
fn sample_surface(b: u32, node: vec2i, u: vec2f, start: u32) -> Sample {
    let t = locate_in_chart(b, node, u, start);
    if t == NONE {
        return Sample(false, vec3f(), NONE);
    }
    return sample_on_triangle(t, node, u);
}

/// True if samples have tangents.
const TANGENTS: bool = true;

/// The tangents df/dx and df/dy on triangle t; 0 without a triangle.
fn tangents(t: u32) -> mat2x3f {
    if t == NONE {
        return mat2x3f(vec3f(), vec3f());
    }
    let p = triangles[t].pose;
    return mat2x3f(vec3f(p[3], p[4], p[5]), vec3f(p[6], p[7], p[8]));
}

/// Finds and stores the triangle of a node whose displacement u was not set by relaxation (method §2, Point location),
/// if the node may move. If no triangle is found, the one at which the walk began is stored: the surface is continued
/// affinely from there.
fn find_triangle(b: u32, s: u32, u: vec2f) {
    if is_fixed(b, s) {
        return;
    }
    let rest = rest_triangle(b, s);
    var t = rest;
    if rest != NONE {
        // The triangle under the node nearest to W(p) is a better start than the one under p.
        let node = node_in_level(b, s);
        let nearest_triangle = nearest(b, node, u);
        let start = select(rest, nearest_triangle, nearest_triangle != NONE);
        t = locate_in_chart(b, node, u, start);
        t = select(t, start, t == NONE);
    }
    set_triangle(b, s, t);
}

/// The triangle under W of the node at slot s of block b.
fn triangle_in_state(b: u32, s: u32, fixed: bool) -> u32 {
    if fixed || params.is_identity != 0u {
        return rest_triangle(b, s);
    }
    return state[state_index(b, TRIANGLE, s)];
}

fn set_triangle(b: u32, s: u32, t: u32) {
    state[state_index(b, TRIANGLE, s)] = t;
}

/// The position at W of the node at slot s of block b with displacement u on triangle t; 0 without a triangle.
fn value_at(b: u32, s: u32, u: vec2f, t: u32, fixed: bool) -> vec3f {
    if t == NONE {
        return vec3f();
    }
    return sample_on_triangle(t, node_in_level(b, s), u).value;
}

/// An edge's chord c (`along`), offset d, length L and 1 / L, which the gradients at both ends share.
struct Chord {
    along: vec3f,
    d: vec2f,
    length: f32,
    inverse: f32,
}

/// The chord between an edge's ends: T d where both ends lie on one triangle (`same`), otherwise the difference of
/// positions. `value` and `tangents` are the sample of the near end, `other` is the position of the far end.
fn chord(value: vec3f, tangents: mat2x3f, other: vec3f, same: bool, d: vec2f) -> Chord {
    let along = select(other - value, tangents[0] * d.x + tangents[1] * d.y, same);
    let length = sqrt(dot(along, along) + TINY);
    return Chord(along, d, length, 1.0 / length);
}

/// dL/du at the near end, with the slopes there.
fn near_gradient(c: Chord, slope: mat2x3f) -> vec2f {
    return -far_gradient(c, slope);
}

/// dL/du at the far end, with the slopes there.
fn far_gradient(c: Chord, slope: mat2x3f) -> vec2f {
    return vec2f(dot(slope[0], c.along), dot(slope[1], c.along)) * c.inverse;
}
