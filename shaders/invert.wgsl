// invert: W⁻¹ at texel centres (method §9; the paper's eq. 9). Each warped cell is two triangles, its diagonal from (0,0) to (1,1).
// Where W(p) = c, the way from c to p is -u(p): a centre inside a triangle gets the displacements of its corners,
// interpolated, which keeps as many digits as they have.
//
// Each centre comes to exactly one triangle, whatever a driver makes of float arithmetic. Warped nodes and centres are
// points of a lattice with 2^29 to 2^30 steps along the tile's longer side. A node gets there by a product with a power
// of 2 and a rounding to a whole number, both of them exact operations, so that all cells around it have the same point.
// On which side of an edge a centre lies is the sign of a difference of two whole numbers: taken from floats where they
// are certain, from 60 bits elsewhere. A centre on an edge counts as moved by (ε, ε²), as on the CPU.
// Rounding to the lattice moves a node by 2^-17 cells at most: corner Jacobians of MIN_JACOBIAN stay positive as long as
// no edge is longer than 300 cells, and then the triangles tile what they tiled at rest.
//
// A workgroup takes a block, or every parts-th row of texels of it. Reads 8 bytes per node and part, and 8 per texel row
// and column of a cell's bounds; writes 8 per texel. Blocks at rest cost the reading of their nodes only.

@group(0) @binding(10) var<storage, read> request: Request;
/// Texel centres on the lattice: columns, then rows.
@group(0) @binding(11) var<storage, read> centres: array<i32>;
/// Displacements: two planes per block.
@group(0) @binding(12) var<storage, read> result: array<f32>;
/// p - c in cells; 0 where no cell comes that has moved.
@group(0) @binding(13) var<storage, read_write> image: array<vec2f>;

const STEPS: i32 = 0x40000000;

/// Displacements of the nodes from (0, 0) to (16, 16) of the block.
var<workgroup> near: array<vec2f, 289>;

/// A node's place on the lattice.
fn warped(node: vec2u, u: vec2f) -> vec2i {
    let steps = clamp(round(u * f32(1u << request.bits)), vec2f(-f32(STEPS)), vec2f(f32(STEPS)));
    return clamp(vec2i(node << vec2u(request.bits)) + vec2i(steps), vec2i(), vec2i(STEPS - 1));
}

/// a b as (high, low): high 2^30 + low, with 0 <= low < 2^30. Both are under 2^30.
fn product(a: i32, b: i32) -> vec2i {
    let high = vec2i(a, b) >> vec2u(15u);
    let low = vec2i(a, b) & vec2i(0x7fff);
    let middle = high.x * low.y + low.x * high.y;
    let rest = ((middle & 0x7fff) << 15u) + low.x * low.y;
    return vec2i(high.x * high.y + (middle >> 15u) + (rest >> 30u), rest & (STEPS - 1));
}

/// True if a centre lies to the left of an edge.
fn is_left(a: vec2i, b: vec2i, centre: vec2i) -> bool {
    let d = b - a;
    let r = centre - a;
    let up = f32(d.x) * f32(r.y);
    let down = f32(d.y) * f32(r.x);
    // Conversions, products and the difference are off by less than half of this, contracted or not.
    if abs(up - down) > 0x1p-20 * (abs(up) + abs(down)) {
        return up > down;
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

/// Cell c of block b, and of its texel rows those of one part.
fn cell(b: u32, c: u32, part: u32) {
    let corner = vec2u(c % 16u, c / 16u);
    let k = corner.y * 17u + corner.x;
    let u = near[k];
    let u_right = near[k + 1u];
    let u_up = near[k + 17u];
    let u_far = near[k + 18u];
    if all(vec4f(u, u_far) == vec4f()) && all(vec4f(u_right, u_up) == vec4f()) {
        return;
    }
    let node = vec2u(blocks[b].x, blocks[b].y) * 16u + corner;
    let o = warped(node, u);
    let right = warped(node + vec2u(1u, 0u), u_right);
    let up = warped(node + vec2u(0u, 1u), u_up);
    let far = warped(node + 1u, u_far);
    let low = min(min(o, far), min(right, up));
    let high = max(max(o, far), max(right, up));
    // The bounds in texels, and more than f32 can be wrong there.
    let size = vec2f(vec2u(request.width, request.height));
    let first = clamp(ceil(vec2f(low) * request.texels - 0.5 - 0x1p-20 * size), vec2f(), size);
    let last = clamp(floor(vec2f(high) * request.texels - 0.5 + 0x1p-20 * size), vec2f(-1.0), size - 1.0);
    let begin_x = u32(first.x);
    let end_x = u32(last.x + 1.0);
    let end_y = min(u32(last.y + 1.0), request.row + request.rows);
    let parts = request.parts;
    let width = request.width;
    let row = request.row;
    var y = max(u32(first.y), row);
    y += parts - 1u - (y + parts - 1u - part) % parts;
    for (; y < end_y; y += parts) {
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
            let du = select(u_right, u_up, above) - u;
            let p = u + (cross2(r, f) / area) * du + (cross2(e, r) / area) * (u_far - u);
            let at = (y - row) * width + x;
            image[at] = -p;
        }
    }
}

@compute @workgroup_size(64)
fn invert(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let k = group.y * SPREAD + group.x;
    if k >= request.count * request.parts {
        return;
    }
    let b = request.first + k / request.parts;
    for (var n = t; n < 289u; n += 64u) {
        let source = window_source(vec2u(n % 17u, n / 17u) + 1u);
        let holder = blocks[b].neighbours[source.x];
        near[n] = vec2f();
        if holder != NONE {
            let at = 2u * holder * NODES + source.y;
            near[n] = vec2f(result[at], result[at + NODES]);
        }
    }
    workgroupBarrier();
    for (var c = t; c < NODES; c += 64u) {
        cell(b, c, k % request.parts);
    }
}
