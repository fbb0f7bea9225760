// invert: W⁻¹ at texel centres (method §9; the paper's eq. 9). Each warped cell is split into two triangles by the
// diagonal from its lower left to its upper right corner. Where W(p) = c, W⁻¹(c) - c is -u(p): a centre inside a
// triangle gets the interpolated displacements of the triangle's corners, which has as many digits as these have.
//
// Each centre is assigned to exactly one triangle, no matter how a driver evaluates floating-point arithmetic. Warped
// nodes and centres are points of a lattice with 2^29 to 2^30 steps along the tile's longer side. A node's lattice
// point is computed by multiplying by a power of 2 and rounding to an integer, both of which are exact operations, so
// that all cells around the node use the same point. The side of an edge on which a centre lies is the sign of a
// difference of two products of integers: it is computed in f32 where that is certain, and in 60-bit integers
// elsewhere. A centre on an edge is treated as if moved by (ε, ε²), as on the CPU. Rounding to the lattice moves a node
// by at most 2^-17 cells (at 16384 cells): corner Jacobians of at least MIN_JACOBIAN stay positive as long as no offset
// within a cell exceeds 300 cells along an axis, and the warped triangles together then cover the same area as at rest.
//
// A workgroup works on a block, or on every `workgroups_per_block`-th texel row of one. Reads 8 bytes per node and
// workgroup (an eighth more for nodes of neighbour blocks), and 4 bytes per texel row and per texel column of a cell's
// bounds; writes 8 per texel. For blocks at rest only the nodes are read.

@group(0) @binding(10) var<storage, read> request: Request;
/// Lattice coordinates of texel centres: x of all columns, then y of all rows.
@group(0) @binding(11) var<storage, read> centres: array<i32>;
/// The result: per block its displacements (2) and another plane.
@group(0) @binding(12) var<storage, read> result: array<f32>;
/// W⁻¹(c) - c in cells; stays 0 outside of moved cells.
@group(0) @binding(13) var<storage, read_write> image: array<vec2f>;

/// Upper end of the lattice coordinates.
const STEPS: i32 = 0x40000000;

/// Displacements of the nodes from (0, 0) to (16, 16) of the block.
var<workgroup> node_u: array<vec2f, 289>;

/// The lattice point of a warped node.
fn lattice_point(node: vec2u, u: vec2f) -> vec2i {
    let steps = clamp(round(u * f32(1u << request.bits)), vec2f(-f32(STEPS)), vec2f(f32(STEPS)));
    return clamp(vec2i(node << vec2u(request.bits)) + vec2i(steps), vec2i(), vec2i(STEPS - 1));
}

/// The product a b as (high, low): a b = high 2^30 + low, with 0 <= low < 2^30. Both |a| and |b| are under 2^30.
fn product(a: i32, b: i32) -> vec2i {
    let high = vec2i(a, b) >> vec2u(15u);
    let low = vec2i(a, b) & vec2i(0x7fff);
    let middle = high.x * low.y + low.x * high.y;
    let rest = ((middle & 0x7fff) << 15u) + low.x * low.y;
    return vec2i(high.x * high.y + (middle >> 15u) + (rest >> 30u), rest & (STEPS - 1));
}

/// True if a centre lies to the left of the edge from a to b.
fn is_left(a: vec2i, b: vec2i, centre: vec2i) -> bool {
    let d = b - a;
    let r = centre - a;
    let plus = f32(d.x) * f32(r.y);
    let minus = f32(d.y) * f32(r.x);
    // The error of conversions, products and difference is less than half of this, contracted or not.
    if abs(plus - minus) > 0x1p-20 * (abs(plus) + abs(minus)) {
        return plus > minus;
    }
    let p = product(d.x, r.y);
    let q = product(d.y, r.x);
    if p.x != q.x {
        return p.x > q.x;
    }
    if p.y != q.y {
        return p.y > q.y;
    }
    return d.y < 0 || (d.y == 0 && d.x > 0);
}

fn cross2(a: vec2f, b: vec2f) -> f32 {
    return a.x * b.y - a.y * b.x;
}

/// Writes the texels in cell c of block b whose rows belong to workgroup `workgroup_of_block` of the block.
fn invert_cell(b: u32, c: u32, workgroup_of_block: u32) {
    let corner = vec2u(c % 16u, c / 16u);
    let k = corner.y * 17u + corner.x;
    let u = node_u[k];
    let u_right = node_u[k + 1u];
    let u_up = node_u[k + 17u];
    let u_far = node_u[k + 18u];
    if all(vec4f(u, u_far) == vec4f()) && all(vec4f(u_right, u_up) == vec4f()) {
        return;
    }
    let node = vec2u(blocks[b].x, blocks[b].y) * 16u + corner;
    let o = lattice_point(node, u);
    let right = lattice_point(node + vec2u(1u, 0u), u_right);
    let up = lattice_point(node + vec2u(0u, 1u), u_up);
    let far = lattice_point(node + 1u, u_far);
    let low = min(min(o, far), min(right, up));
    let high = max(max(o, far), max(right, up));
    // Bounds of the cell in texels, widened by more than the error of f32.
    let size = vec2f(vec2u(request.width, request.height));
    let first = clamp(ceil(vec2f(low) * request.texels_per_step - 0.5 - 0x1p-20 * size), vec2f(), size);
    let last = clamp(floor(vec2f(high) * request.texels_per_step - 0.5 + 0x1p-20 * size), vec2f(-1.0), size - 1.0);
    let begin_x = u32(first.x);
    let end_x = u32(last.x + 1.0);
    let end_y = min(u32(last.y + 1.0), request.row + request.rows);
    let workgroups_per_block = request.workgroups_per_block;
    let width = request.width;
    let row = request.row;
    var y = max(u32(first.y), row);
    y += workgroups_per_block - 1u - (y + workgroups_per_block - 1u - workgroup_of_block) % workgroups_per_block;
    for (; y < end_y; y += workgroups_per_block) {
        let centre_y = centres[width + y];
        for (var x = begin_x; x < end_x; x++) {
            let centre = vec2i(centres[x], centre_y);
            let above = is_left(o, far, centre);
            let middle = select(right, up, above);
            if is_left(o, middle, centre) == above || is_left(middle, far, centre) == above {
                continue;
            }
            let e = vec2f(middle - o);
            let f = vec2f(far - o);
            let r = vec2f(centre - o);
            let area = cross2(e, f);
            // Only the paper's solver produces triangles without area, or with an area too small for f32.
            if area == 0.0 {
                continue;
            }
            let du = select(u_right, u_up, above) - u;
            let s = clamp(cross2(r, f) / area, 0.0, 1.0);
            let p = u + s * du + clamp(cross2(e, r) / area, 0.0, 1.0 - s) * (u_far - u);
            let at = (y - row) * width + x;
            image[at] = -p;
        }
    }
}

@compute @workgroup_size(64)
fn invert(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let k = group.y * SPREAD + group.x;
    if k >= request.count * request.workgroups_per_block {
        return;
    }
    let b = request.first + k / request.workgroups_per_block;
    for (var n = t; n < 289u; n += 64u) {
        let source = window_source(vec2u(n % 17u, n / 17u) + 1u);
        let holder = blocks[b].neighbours[source.x];
        node_u[n] = vec2f();
        if holder != NONE {
            let at = FINEST_STATE_PLANES * holder * NODES + source.y;
            node_u[n] = vec2f(result[at], result[at + NODES]);
        }
    }
    workgroupBarrier();
    for (var c = t; c < NODES; c += 64u) {
        invert_cell(b, c, k % request.workgroups_per_block);
    }
}
