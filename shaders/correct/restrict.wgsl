// correct: the contributions of a smoothed block to the coarser level's right-hand side (method §7.4). The residual
// after a pass of the smoother is r - A z, and z is a sum over blocks: each block restricts r at its own nodes minus A
// z for its own z, which reaches one node beyond the block. It therefore does not depend on the other blocks of the
// same dispatch, and it can reuse the matrix that smoothing has just read. A block contributes to the 10x10 coarse
// nodes over and around it.

/// Per block of the coarser level and per quarter: 10x10 contributions, to the coarse nodes from (-1, -1) to (8, 8) of
/// the quarter.
@group(0) @binding(11) var<storage, read_write> leaving: array<vec2f>;

/// r - A z at the nodes from (-1, -1) to (16, 16), in rows of 18, where r and z are 0 outside the block.
var<workgroup> residuals: array<vec2f, 324>;

fn residual_at(n: vec2i) -> vec2f {
    if any(n < vec2i(-1)) || any(n > vec2i(16)) {
        return vec2f();
    }
    return residuals[u32((n.y + 1) * 18 + n.x + 1)];
}

/// The sum along x of the restricted values at the nodes n - (1, 0), n and n + (1, 0), with n in a coarse column.
fn restricted_in_x(n: vec2i) -> vec2f {
    var sum = residual_at(n);
    if n.x > -2 {
        let west = n - vec2i(1, 0);
        sum += (1.0 - weight_at(west)) * residual_at(west);
    }
    if n.x < 16 {
        let east = n + vec2i(1, 0);
        sum += weight_at(east) * residual_at(east);
    }
    return sum;
}

fn is_inside(n: vec2i) -> bool {
    return all(n >= vec2i(0)) && all(n < vec2i(16));
}

/// A_pn z_n for neighbour k of node n of the halo, where z is 0 outside the block.
fn reach_along(b: u32, n: vec2i, k: u32) -> vec2f {
    let far = n + offset(k);
    if !is_inside(far) {
        return vec2f();
    }
    return pair_times(load_pair(b, n, k), window_z[place(u32(far.x + 1), u32(far.y + 1))]);
}

/// The sum of these over the neighbours inside the block, of which a node has up to three.
fn reach(b: u32, n: vec2i) -> vec2f {
    var inward = select(vec3u(3u, 4u, 6u), vec3u(0u, 2u, 7u), n.x < 0);
    inward = select(inward, vec3u(5u, 6u, 7u), n.y > 15);
    inward = select(inward, vec3u(1u, 2u, 3u), n.y < 0);
    return reach_along(b, n, inward.x) + reach_along(b, n, inward.y) + reach_along(b, n, inward.z);
}

/// Node k of the 68 of the halo: the row below, the row above, then the columns.
fn halo_node(k: u32) -> vec2i {
    let at = i32(k % 2u) * 17 - 1;
    let along = i32(k / 2u) - 1;
    return select(vec2i(at, along - 17), vec2i(along, at), along < 17);
}

/// Writes the contributions of block b; the window holds its z, and `row` and `right` are those of this thread's node.
fn contribute(b: u32, row: NodeRow, right: vec2f, t: u32) {
    let parent = blocks[b].parents[0];
    if parent == NONE || params.has_coarser == 0u {
        return;
    }
    let own = node_at(t);
    residuals[(own.y + 1u) * 18u + own.x + 1u] = right - times_window(row, t);
    if t < 68u {
        let n = halo_node(t);
        var value = vec2f();
        // Nodes of inactive blocks have no pairs.
        if active_neighbour(b, window_source(vec2u(n + 1)).x) != NONE {
            value = -reach(b, n);
        }
        residuals[u32((n.y + 1) * 18 + n.x + 1)] = value;
    }
    workgroupBarrier();
    let quarter = (blocks[b].y & 1u) * 2u + (blocks[b].x & 1u);
    let first = (parent * 4u + quarter) * 100u;
    if t < 100u {
        let c = 2 * (vec2i(i32(t % 10u), i32(t / 10u)) - 1);
        var sum = vec2f();
        // The row of nodes below the window has nothing to restrict.
        if c.y > -2 {
            sum = restricted_in_x(c);
            let south = c - vec2i(0, 1);
            sum += (1.0 - weight_at(south)) * restricted_in_x(south);
        }
        if c.y < 16 {
            let north = c + vec2i(0, 1);
            sum += weight_at(north) * restricted_in_x(north);
        }
        leaving[first + t] = sum;
    }
}
