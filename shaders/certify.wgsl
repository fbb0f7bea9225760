// certify: the certificate of a warp on level 0, from all corner Jacobians of its cells (method §8). WGSL has no f64,
// so a bound of the rounding error is subtracted from each Jacobian. For offsets of up to a few cells within a cell (a
// search found no exception up to 4) a positive difference proves that the exact Jacobian is positive. For longer ones
// the bound may be too small (method §8 has figures); they are covered by the condition that the energy is finite, that
// is, that all Jacobians are at least CRUSHED_JACOBIAN in f32, which suffices for offsets of up to 100 cells.
//
// The entry `certify` reads 8 bytes per node (a quarter more for the halo) and writes 12 per block. The state of level
// 0 is then the result; the entry `fall_back` writes 8 bytes per node of charts that did not pass.

var<workgroup> window_u: array<vec2f, 324>;
var<workgroup> certificates: array<vec4f, 64>;

/// Four units of rounding, 4 x 2^-24, rounded up. For offsets of up to a few cells this exceeds the error of the two
/// subtractions, of the products and of their difference; for longer offsets it need not (method §8).
const ROUNDING: f32 = 2.4e-7;

/// (a - o) x (b - o) in f32, minus the bound of its rounding error.
fn lower_bound_of_cross(o: vec2f, a: vec2f, b: vec2f) -> f32 {
    let p = a - o;
    let q = b - o;
    let bound = (abs(p.x) + 1.0) * (abs(q.y) + 1.0) + (abs(p.y) + 1.0) * (abs(q.x) + 1.0);
    return (p.x * q.y - p.y * q.x) - ROUNDING * bound;
}

@compute @workgroup_size(64)
fn certify(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    var largest = 0.0;
    for (var k = t; k < WINDOW; k += 64u) {
        let n = window_node(k);
        let source = window_source(n);
        let holder = blocks[b].neighbours[source.x];
        window_u[k] = vec2f();
        if holder != NONE {
            window_u[k] = displacement(holder, source.y);
            if source.x == 4u {
                // The length of a tiny displacement may be rounded to 0, as if nothing had moved.
                largest = max(largest, max(length(window_u[k]), max(abs(window_u[k].x), abs(window_u[k].y))));
            }
        }
    }
    workgroupBarrier();
    var worst = 1.0;
    var folds = 0.0;
    // Cells whose lower left nodes are (-1, -1) to (15, 15) of this block. A cell whose lower left node lies in another
    // block is left to that block if it is active, since it is then checked there.
    for (var k = t; k < 289u; k += 64u) {
        let cell = vec2u(k % 17u, k / 17u);
        let holder = select(3u, 0u, cell.y == 0u) + select(0u, 1u, cell.x > 0u);
        if holder == 4u || blocks[b].active_neighbours[holder] == NONE {
            // Subtract the displacement of the lower left node first, then add the exact offset at rest.
            let u = window_u[place(cell.x, cell.y)];
            let right = window_u[place(cell.x + 1u, cell.y)] - u + vec2f(1.0, 0.0);
            let up = window_u[place(cell.x, cell.y + 1u)] - u + vec2f(0.0, 1.0);
            let both = window_u[place(cell.x + 1u, cell.y + 1u)] - u + vec2f(1.0, 1.0);
            let zero = vec2f();
            let corners = vec4f(
                lower_bound_of_cross(zero, right, up), lower_bound_of_cross(right, both, zero),
                lower_bound_of_cross(up, zero, both), lower_bound_of_cross(both, up, right)
            );
            for (var c = 0u; c < 4u; c++) {
                if corners[c] > 0.0 && is_finite(corners[c]) {
                    worst = min(worst, corners[c]);
                } else {
                    worst = min(worst, select(-INVALID_ENERGY, corners[c], is_finite(corners[c])));
                    folds += 1.0;
                }
            }
        }
    }
    certificates[t] = vec4f(0.0, worst, folds, largest);
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if t < half {
            let own = certificates[t];
            let other = certificates[t + half];
            certificates[t] = vec4f(0.0, min(own.y, other.y), own.z + other.z, max(own.w, other.w));
        }
        workgroupBarrier();
    }
    if t == 0u {
        let at = group.y * SPREAD + group.x;
        partials[sum_index(SUM_LEAST_JACOBIAN, at)] = certificates[0].y;
        partials[sum_index(SUM_FOLDS, at)] = certificates[0].z;
        partials[sum_index(SUM_LARGEST, at)] = certificates[0].w;
    }
}

/// Writes the identity for charts that did not pass.
@compute @workgroup_size(64)
fn fall_back(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE || charts[blocks[b].chart].fallback == 0u {
        return;
    }
    for (var k = 0u; k < 4u; k++) {
        set_displacement(b, thread_slot(k, t), vec2f());
    }
}
