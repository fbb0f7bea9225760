// certify: all corner Jacobians of a warp. WGSL has no f64: each Jacobian is taken less a bound of what rounding can have
// added to it, so that one over 0 is over 0 in exact arithmetic too. Reads 8 bytes per node, writes 16 per block; the
// result is written in a second pass, 8 bytes per node.

/// The result: two planes per block.
@group(0) @binding(10) var<storage, read_write> result: array<f32>;

var<workgroup> near: array<vec2f, 324>;
var<workgroup> found: array<vec4f, 64>;

/// Four units of rounding at 1: more than the two subtractions, the products and their difference can add.
const ROUNDING: f32 = 2.4e-7;

/// (q - o) x (r - o), at most.
fn lower_cross(o: vec2f, a: vec2f, b: vec2f) -> f32 {
    let p = a - o;
    let q = b - o;
    let bound = (abs(p.x) + 1.0) * (abs(q.y) + 1.0) + (abs(p.y) + 1.0) * (abs(q.x) + 1.0);
    return (p.x * q.y - p.y * q.x) - ROUNDING * bound;
}

@compute @workgroup_size(64)
fn certify(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    var largest = 0.0;
    for (var k = t; k < WINDOW; k += 64u) {
        let n = window_node(k);
        let source = window_source(n);
        let holder = blocks[b].neighbours[source.x];
        near[k] = vec2f();
        if holder != NONE {
            near[k] = displacement(holder, source.y);
            if source.x == 4u {
                largest = max(largest, max(abs(near[k].x), abs(near[k].y)));
            }
        }
    }
    workgroupBarrier();
    var worst = 1.0;
    var folds = 0.0;
    // Cells from (-1, -1) to (15, 15); one on the rim is left to the block that holds its lower left node, if that
    // block is checked too.
    for (var k = t; k < 289u; k += 64u) {
        let cell = vec2u(k % 17u, k / 17u);
        let holder = select(3u, 0u, cell.y == 0u) + select(0u, 1u, cell.x > 0u);
        if holder == 4u || blocks[b].active_neighbours[holder] == NONE {
            // Displacements relative to the lower left node's: the cell's own size stays exact.
            let u = near[place(cell.x, cell.y)];
            let right = near[place(cell.x + 1u, cell.y)] - u + vec2f(1.0, 0.0);
            let up = near[place(cell.x, cell.y + 1u)] - u + vec2f(0.0, 1.0);
            let both = near[place(cell.x + 1u, cell.y + 1u)] - u + vec2f(1.0, 1.0);
            let zero = vec2f();
            let corners = vec4f(
                lower_cross(zero, right, up), lower_cross(right, both, zero),
                lower_cross(up, zero, both), lower_cross(both, up, right)
            );
            for (var c = 0u; c < 4u; c++) {
                if corners[c] > 0.0 && is_number(corners[c]) {
                    worst = min(worst, corners[c]);
                } else {
                    worst = min(worst, select(-INVALID_ENERGY, corners[c], is_number(corners[c])));
                    folds += 1.0;
                }
            }
        }
    }
    found[t] = vec4f(0.0, worst, folds, largest);
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if t < half {
            let other = found[t + half];
            found[t] = vec4f(0.0, min(found[t].y, other.y), found[t].z + other.z, max(found[t].w, other.w));
        }
        workgroupBarrier();
    }
    if t == 0u {
        partials[params.partial + group.y * SPREAD + group.x] = found[0];
    }
}

/// The warp, or the identity where nothing better was found.
@compute @workgroup_size(64)
fn finish(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    let better = charts[blocks[b].chart].fallback == 0u;
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        let u = select(vec2f(), displacement(b, s), better);
        let to = 2u * b * NODES + s;
        result[to] = u.x;
        result[to + NODES] = u.y;
    }
}
