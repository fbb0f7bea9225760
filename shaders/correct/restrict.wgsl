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

/// Writes the contributions of block b; the window holds its z.
fn contribute(b: u32, t: u32) {
    let parent = blocks[b].parents[0];
    if parent == NONE {
        return;
    }
    for (var k = t; k < 324u; k += 64u) {
        let n = vec2i(i32(k % 18u), i32(k / 18u)) - 1;
        let source = window_source(vec2u(n + 1));
        var value = vec2f();
        // Nodes of inactive blocks have no pairs.
        if blocks[b].active_neighbours[source.x] != NONE {
            value = -off_diagonal(b, n, true);
            if is_inside(n) {
                let z = window_z[place_of_slot(source.y)];
                value = right[source.y] + (value - diagonal_times(b, source.y, z));
            }
        }
        residuals[k] = value;
    }
    workgroupBarrier();
    let quarter = (blocks[b].y & 1u) * 2u + (blocks[b].x & 1u);
    let first = ((params.other_base + parent) * 4u + quarter) * 100u;
    for (var k = t; k < 100u; k += 64u) {
        let c = 2 * (vec2i(i32(k % 10u), i32(k / 10u)) - 1);
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
        leaving[first + k] = sum;
    }
}
