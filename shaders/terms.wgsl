// The terms of the energy that depend on one node of a patch, and their derivatives (method §4). Gradients and matrices
// are halves of derivatives.

/// One edge of a node. The near end is the node, the far end its neighbour.
struct Edge {
    neighbour: u32,
    chord: Chord,
    /// Rest length l.
    length: f32,
    inverse_length: f32,
    weight: f32,
    /// 1 / |d0|^2, where d0 is the offset at rest.
    inverse_d0_square: f32,
    offset: vec2f,
    /// kappa: the mean of both ends' weights of the orientation term.
    orientation: f32,
}

fn density(at: u32) -> f32 {
    return bitcast<f32>(patch_extra[at]);
}

/// Across the open border near node n of a block, along which texture slides: 1 - distance long, or 0 far from one.
fn across_border(n: vec2u) -> vec2f {
    if params.hold == 0.0 {
        return vec2f();
    }
    return unpack2x16snorm(patch_extra[place_at(n, vec2i())]);
}

/// The energy of the hold at a node near an open border.
fn hold(n: vec2u, u: vec2f) -> f32 {
    let moved = dot(across_border(n), u);
    return params.hold * moved * moved;
}

/// Edge k of node n of a block. `p` is the state of the node; `floor` is the least length that strains refer to.
fn edge(n: vec2u, p: NodeState, k: u32, floor: f32) -> Edge {
    let o = offset(k);
    let at_node = place_at(n, vec2i());
    let at_neighbour = place_at(n, o);
    let d = (patch_u[at_neighbour] - p.u) + vec2f(o);
    let length = patch_length[select(at_node, at_neighbour, k > 3u)][k & 3u];
    let same = (patch_tag[at_neighbour] & 0xfffffffeu) == p.tag;
    let chord = chord(p.value, p.tangents, patch_value[at_neighbour].xyz, same, d);
    let weight = max(patch_value[at_node].w, patch_value[at_neighbour].w);
    let inverse_d0_square = select(1.0, 0.5, (k & 2u) != 0u);
    var kappa = params.orientation;
    if params.orientation_density > 0.0 {
        kappa += params.orientation_density * 0.5 * (density(at_node) + density(at_neighbour));
    }
    return Edge(at_neighbour, chord, length, 1.0 / max(length, floor), weight, inverse_d0_square, vec2f(o), kappa);
}

/// sigma = (lambda max(0, 1 - w) + lambda0) / |d0|^2: the weight of the smoothness term.
fn smoothness(e: Edge) -> f32 {
    return (max(1.0 - e.weight, 0.0) * params.smoothness + params.smoothness_floor) * e.inverse_d0_square;
}

/// The stress stiffness of the edge (method §4, Derivatives).
fn stress_stiffness(e: Edge) -> f32 {
    let strain = (e.chord.length - e.length) * e.inverse_length;
    let size = max(strain * TENSION_STIFFNESS, strain * -COMPRESSION_STIFFNESS);
    let square = max(dot(e.chord.d, e.chord.d), MIN_OFFSET_SQUARE / e.inverse_d0_square);
    let weight = e.weight + max(e.weight - 1.0, 0.0) * (HARM_STRESS - 1.0);
    return weight * size * (e.chord.length * e.inverse_length) / square;
}

/// Scalar product of d with d0 rotated by 90 degrees (not a unit vector: its length is |d0|).
fn off_axis(e: Edge) -> f32 {
    return e.chord.d.y * e.offset.x - e.chord.d.x * e.offset.y;
}

fn edge_energy(e: Edge) -> f32 {
    let strain = (e.chord.length - e.length) * e.inverse_length;
    let rest = e.chord.d - e.offset;
    let off = off_axis(e);
    return e.weight * strain * strain + smoothness(e) * dot(rest, rest)
        + off * off * (e.orientation * e.inverse_d0_square * e.inverse_d0_square);
}

/// The room term of a corner: beta max(0, tau - J)^2.
fn room(jacobian: f32) -> f32 {
    let lack = max(params.room_threshold - jacobian, 0.0);
    return lack * lack * params.room;
}

/// Offsets from a node to the other three corners of a cell around it: to the x-neighbour (a), the y-neighbour (b) and
/// the opposite corner (c). `sign` is the product s_x s_y of method §1, Corner Jacobians.
struct CellOffsets {
    a: vec2f,
    b: vec2f,
    c: vec2f,
    sign: f32,
}

fn cell_offsets(n: vec2u, u: vec2f, q: u32) -> CellOffsets {
    let s = quadrant(q);
    let x = vec2i(s.x, 0);
    let y = vec2i(0, s.y);
    return CellOffsets(
        (patch_u[place_at(n, x)] - u) + vec2f(x),
        (patch_u[place_at(n, y)] - u) + vec2f(y),
        (patch_u[place_at(n, s)] - u) + vec2f(s),
        f32(s.x * s.y)
    );
}

/// A corner Jacobian J, and its gradient with respect to the node from which the offsets a and b start; J is affine in
/// the position of this node.
struct Corner {
    jacobian: f32,
    slope: vec2f,
}

fn corner(a: vec2f, b: vec2f, sign: f32) -> Corner {
    return Corner((a.x * b.y - a.y * b.x) * sign, vec2f(a.y - b.y, b.x - a.x) * sign);
}

/// Corner k of the three whose Jacobians depend on a node of a cell: at the node itself, at its x-neighbour, at its
/// y-neighbour. The gradient is with respect to the node.
fn cell_corner(m: CellOffsets, k: u32) -> Corner {
    if k == 0u {
        return corner(m.a, m.b, m.sign);
    }
    if k == 1u {
        return corner(m.a, m.c, m.sign);
    }
    return corner(m.c, m.b, m.sign);
}

fn outer(v: vec2f) -> vec3f {
    return vec3f(v.x * v.x, v.x * v.y, v.y * v.y);
}
