// The energy seen from one node of a patch: its terms, their gradient, and their Gauss-Newton matrix (method §4).

/// One edge of a node.
struct Edge {
    at: u32,
    chord: Chord,
    /// Rest length, and 1 over the same, floored.
    length: f32,
    inverse: f32,
    weight: f32,
    /// 1 / |d0|^2.
    shorter: f32,
    offset: vec2f,
    /// kappa, the mean of both ends'.
    orientation: f32,
}

/// Edge k of node n of a block, the node being at p.
fn edge(n: vec2u, p: Here, k: u32, floor: f32) -> Edge {
    let o = offset(k);
    let own = seen(n, vec2i());
    let at = seen(n, o);
    let d = (near_u[at] - p.u) + vec2f(o);
    let length = near_length[select(own, at, k > 3u)][k & 3u];
    let same = (near_tag[at] & 0xfffffffeu) == p.tag;
    let chord = chord(p.value, p.slope, near_value[at].xyz, same, d);
    let weight = max(near_value[own].w, near_value[at].w);
    let shorter = 1.0 / f32(o.x * o.x + o.y * o.y);
    var kappa = params.orientation;
    if params.orientation_density > 0.0 {
        kappa += params.orientation_density * 0.5 * (near_density[own] + near_density[at]);
    }
    return Edge(at, chord, length, 1.0 / max(length, floor), weight, shorter, vec2f(o), kappa);
}

/// (lambda (1 - w) + lambda0) / |d0|^2.
fn smoothness(e: Edge) -> f32 {
    return ((1.0 - e.weight) * params.smoothness + params.smoothness_floor) * e.shorter;
}

/// |d0| times d0 turned by 90 degrees, along d.
fn off_axis(e: Edge) -> f32 {
    return e.chord.d.y * e.offset.x - e.chord.d.x * e.offset.y;
}

fn edge_energy(e: Edge) -> f32 {
    let strain = (e.chord.length - e.length) * e.inverse;
    let rest = e.chord.d - e.offset;
    let off = off_axis(e);
    return e.weight * strain * strain + smoothness(e) * dot(rest, rest)
        + off * off * (e.orientation * e.shorter * e.shorter);
}

/// beta max(0, tau - J)^2.
fn room(jacobian: f32) -> f32 {
    let lack = max(params.room_threshold - jacobian, 0.0);
    return lack * lack * params.room;
}

/// To the x-neighbour, the y-neighbour and the far one of the cell in quadrant q, from a node at u.
struct Arms {
    a: vec2f,
    b: vec2f,
    c: vec2f,
    sign: f32,
}

fn arms(n: vec2u, u: vec2f, q: u32) -> Arms {
    let s = quadrant(q);
    let x = vec2i(s.x, 0);
    let y = vec2i(0, s.y);
    return Arms(
        (near_u[seen(n, x)] - u) + vec2f(x),
        (near_u[seen(n, y)] - u) + vec2f(y),
        (near_u[seen(n, s)] - u) + vec2f(s),
        f32(s.x * s.y)
    );
}

/// A corner Jacobian from its two arms; it is affine in the node, with this gradient.
struct Corner {
    jacobian: f32,
    slope: vec2f,
}

fn corner(a: vec2f, b: vec2f, sign: f32) -> Corner {
    return Corner((a.x * b.y - a.y * b.x) * sign, vec2f(a.y - b.y, b.x - a.x) * sign);
}

/// Corner k of the three in a cell that a node touches: its own, its x-neighbour's, its y-neighbour's.
fn corner_of(m: Arms, k: u32) -> Corner {
    if k == 0u {
        return corner(m.a, m.b, m.sign);
    }
    if k == 1u {
        return corner(m.a, m.c, m.sign);
    }
    return corner(m.c, m.b, m.sign);
}

/// Energy of the edges and corners of a node.
fn node_energy(n: vec2u, p: Here, floor: f32) -> f32 {
    var energy = 0.0;
    for (var k = 0u; k < 8u; k++) {
        energy += edge_energy(edge(n, p, k, floor));
    }
    for (var q = 0u; q < 4u; q++) {
        let m = arms(n, p.u, q);
        for (var k = 0u; k < 3u; k++) {
            energy += room(corner_of(m, k).jacobian);
        }
    }
    return energy;
}

/// Halves of the derivatives of a node's energy, and its Gauss-Newton matrix (xx, xy, yy).
struct Local {
    energy: f32,
    gradient: vec2f,
    matrix: vec3f,
}

fn outer(v: vec2f) -> vec3f {
    return vec3f(v.x * v.x, v.x * v.y, v.y * v.y);
}

fn local_problem(n: vec2u, p: Here, floor: f32) -> Local {
    var out = Local(0.0, vec2f(), vec3f());
    for (var k = 0u; k < 8u; k++) {
        let e = edge(n, p, k, floor);
        out.energy += edge_energy(e);
        let near = near_gradient(e.chord, p.slope);
        let scaled = e.weight * e.inverse;
        let smooth_weight = smoothness(e);
        out.gradient += scaled * ((e.chord.length - e.length) * e.inverse) * near
            - smooth_weight * (e.chord.d - e.offset);
        out.matrix += scaled * e.inverse * outer(near) + vec3f(smooth_weight, 0.0, smooth_weight);
        let normal = vec2f(-e.offset.y, e.offset.x);
        let kappa = e.orientation * e.shorter * e.shorter;
        out.gradient -= off_axis(e) * kappa * normal;
        out.matrix += kappa * outer(normal);
    }
    for (var q = 0u; q < 4u; q++) {
        let m = arms(n, p.u, q);
        for (var k = 0u; k < 3u; k++) {
            let c = corner_of(m, k);
            let lack = max(params.room_threshold - c.jacobian, 0.0);
            out.energy += lack * lack * params.room;
            out.gradient -= lack * params.room * c.slope;
            out.matrix += select(0.0, params.room, c.jacobian < params.room_threshold) * outer(c.slope);
        }
    }
    return out;
}
