// correct, first step: assembles the Gauss-Newton system of a level (method §7.1). For each pair of neighbours p and n
// it sums w / l^2 g_p g_n' and the other terms that depend on both; the pair is stored once, with the node that owns
// the edge. The right-hand side is minus the gradient (matrix and gradient are halves of derivatives). Per node it
// reads what relax reads, and writes 52 bytes; it reads 44 per triangle. Each thread has one node, and visits each of
// its edges and corners once.

const PATCH_THREADS: u32 = 256u;

/// The near-bound penalty's stiffness at a corner (method §7.1).
fn near_bound(jacobian: f32) -> f32 {
    return select(0.0, NEAR_BOUND_STIFFNESS, jacobian < NEAR_BOUND_JACOBIAN);
}

/// The outer product a b', row-major.
fn outer_pair(a: vec2f, b: vec2f) -> vec4f {
    return vec4f(a.x * b.x, a.x * b.y, a.y * b.x, a.y * b.y);
}

/// The sums over a thread's node: its share of the energy, its least corner Jacobian, its gradient, and its diagonal
/// block.
var<private> energy: f32;
var<private> worst: f32;
var<private> gradient: vec2f;
var<private> diagonal: vec3f;

/// A cell's parts in the pairs of one of its nodes with the x-neighbour, the y-neighbour and the opposite node.
struct CellPairs {
    x: vec4f,
    y: vec4f,
    across: vec4f,
}

/// Adds the corner between the offsets a and b, whose energy `sharers` movable nodes share. Returns the gradient's part
/// of its products dJ/dp dJ/dn' with the other two nodes; the sign of all derivatives cancels in them.
fn add_corner(a: vec2f, b: vec2f, sign: f32, sharers: f32) -> vec2f {
    let c = corner(a, b, sign);
    let lack = max(params.room_threshold - c.jacobian, 0.0);
    let stiffness = select(0.0, params.room, c.jacobian < params.room_threshold) + near_bound(c.jacobian);
    energy += lack * lack * params.room / sharers;
    worst = min(worst, c.jacobian);
    gradient -= lack * params.room * c.slope;
    diagonal += stiffness * outer(c.slope);
    return stiffness * vec2f(a.y - b.y, b.x - a.x);
}

/// Adds the three corners of cell q that depend on node n.
fn add_cell(n: vec2u, u: vec2f, q: u32) -> CellPairs {
    let m = cell_offsets(n, u, q);
    let s = quadrant(q);
    let at_x = movable(n, vec2i(s.x, 0));
    let at_y = movable(n, vec2i(0, s.y));
    let at_c = movable(n, s);
    let xy = add_corner(m.a, m.b, m.sign, at_x + at_y + 1.0);
    let xc = add_corner(m.a, m.c, m.sign, at_x + at_c + 1.0);
    let cy = add_corner(m.c, m.b, m.sign, at_y + at_c + 1.0);
    let a = vec2f(m.a.y, -m.a.x);
    let b = vec2f(m.b.y, -m.b.x);
    let c = vec2f(m.c.y, -m.c.x);
    return CellPairs(
        outer_pair(xy, b) + outer_pair(xc, c),
        -outer_pair(xy, a) - outer_pair(cy, c),
        outer_pair(cy, b) - outer_pair(xc, a)
    );
}

/// Adds edge k, and writes its pair if the node owns it. `corners` is the corners' part of the pair; `at` is the node's
/// place in `rows`.
fn add_edge(b: u32, n: vec2u, p: NodeState, own: mat2x3f, floor: f32, k: u32, corners: vec4f, at: u32) {
    let e = edge(n, p, k, floor);
    let counts = !fixed_in_patch(e.neighbour);
    let near = near_gradient(e.chord, own);
    let square = e.weight * e.inverse_length * e.inverse_length;
    let smooth_weight = smoothness(e);
    let isotropic = smooth_weight + stress_stiffness(e) + params.pull * e.inverse_d0_square;
    let normal = vec2f(-e.offset.y, e.offset.x);
    let turn = e.orientation * e.inverse_d0_square * e.inverse_d0_square;
    energy += select(1.0, 0.5, counts) * edge_energy(e);
    gradient += (square * (e.chord.length - e.length)) * near - smooth_weight * (e.chord.d - e.offset)
        - (off_axis(e) * turn) * normal;
    diagonal += square * outer(near) + vec3f(isotropic, 0.0, isotropic) + turn * outer(normal);
    // Only pairs of two movable nodes count.
    var pair = vec4f();
    if counts {
        let far = far_gradient(e.chord, slopes_of(b, vec2i(n) + offset(k)));
        pair = square * outer_pair(near, far) - vec4f(isotropic, 0.0, 0.0, isotropic) - turn * outer_pair(normal, normal)
            + corners;
    }
    diagonal += rounding_loss(pair, k);
    if k < 4u {
        let words = encode(pair);
        rows[at + (PAIR + 2u * k) * NODES] = words.x;
        rows[at + (PAIR + 2u * k + 1u) * NODES] = words.y;
    }
}

fn assemble_node(b: u32, n: vec2u, at: u32) {
    let floor = charts[blocks[b].chart].length_floor * params.scale;
    let p = node_state(n);
    let own = slopes_of(b, vec2i(n));
    let across = across_border(n);
    let moved = dot(across, p.u);
    energy = params.hold * moved * moved;
    gradient = params.hold * moved * across;
    diagonal = params.hold * outer(across);
    let north_east = add_cell(n, p.u, 0u);
    let north_west = add_cell(n, p.u, 1u);
    let south_east = add_cell(n, p.u, 2u);
    let south_west = add_cell(n, p.u, 3u);
    add_edge(b, n, p, own, floor, 0u, north_east.x + south_east.x, at);
    add_edge(b, n, p, own, floor, 1u, north_east.y + north_west.y, at);
    add_edge(b, n, p, own, floor, 2u, north_east.across, at);
    add_edge(b, n, p, own, floor, 3u, north_west.across, at);
    add_edge(b, n, p, own, floor, 4u, north_west.x + south_west.x, at);
    add_edge(b, n, p, own, floor, 5u, south_east.y + south_west.y, at);
    add_edge(b, n, p, own, floor, 6u, south_west.across, at);
    add_edge(b, n, p, own, floor, 7u, south_east.across, at);
}

@compute @workgroup_size(256)
fn assemble(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) s: u32) {
    let b = block_of_workgroup(group, s);
    if b == NONE {
        return;
    }
    load_patch(b, s);
    load_slopes(b, s);
    let n = node_at(s);
    let at = row_index(b, 0u, s);
    energy = 0.0;
    worst = 1.0;
    gradient = vec2f();
    if fixed_in_patch(place_at(n, vec2i())) {
        // A fixed node has the identity as its diagonal, so that the smoother does not divide by zero.
        diagonal = vec3f(1.0, 0.0, 1.0);
        for (var c = 0u; c < 8u; c++) {
            rows[at + (PAIR + c) * NODES] = 0u;
        }
    } else {
        assemble_node(b, n, at);
    }
    rows[at] = bitcast<u32>(diagonal.x);
    rows[at + NODES] = bitcast<u32>(diagonal.y);
    rows[at + 2u * NODES] = bitcast<u32>(diagonal.z);
    vectors[vector_index(b, RESIDUAL, s)] = -gradient.x;
    vectors[vector_index(b, RESIDUAL + 1u, s)] = -gradient.y;
    // The energy before the correction. It is added up before its memory is used for other quantities.
    let sum = energy_of_block(s, energy, worst, false);
    if s == 0u {
        vectors[vector_index(b, ENERGY_BEFORE, 0u)] = sum;
    }
}
