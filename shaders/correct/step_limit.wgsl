// correct: the step limit (method §7.6): the step fraction phi of each node. The first fractions leave every corner
// Jacobian a part of its margin over MIN_JACOBIAN and fall off smoothly around corners that would lose more; rounds of
// shrinking treat the corners that would still lose too much. Charts whose whole step leaves enough margin are
// done. Per node: `first_fractions` reads 16 bytes and writes 8; `mark_corners` reads 20 and writes 4 (both a quarter
// more for the halo); `shrink_fractions` reads 8 (more for a halo of two nodes, marks of three) and writes 4.

var<workgroup> window_u: array<vec2f, 324>;
var<workgroup> window_step: array<vec2f, 324>;

/// The first round that looks for folds: only dispatches of the falloff come before it.
const FIRST_SHRINKING_ROUND: u32 = FIRST_FALLOFF_PASSES / FALLOFF_PASSES;

/// Sets each node's fraction of the step to the largest that its corners allow if all nodes take the same. A chart with
/// a fraction under 1 is limited.
@compute @workgroup_size(64)
fn first_fractions(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].neighbours[source.x];
        window_u[k] = vec2f();
        window_step[k] = vec2f();
        if holder != NONE {
            window_u[k] = displacement(holder, source.y);
            if blocks[holder].is_active != 0u {
                window_step[k] = step_vector(holder, source.y);
            }
        }
    }
    workgroupBarrier();
    var limited = false;
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        let fraction = allowed_fraction(node_at(s), KEPT_MARGIN);
        vectors[vector_index(b, FRACTION, s)] = fraction;
        vectors[vector_index(b, MARK, s)] = 1.0;
        limited = limited || fraction < 1.0;
    }
    if limited {
        atomicMax(&charts[blocks[b].chart].limit_rounds, FIRST_SHRINKING_ROUND);
    }
}

/// The smallest normal f32: keeps a quotient finite.
const SMALLEST: f32 = 1.1754944e-38;

/// The smallest fraction that the twelve corners of node n allow if each keeps the fraction `kept` of its margin (method
/// §7.6, Fraction per corner).
fn allowed_fraction(n: vec2u, kept: f32) -> f32 {
    var fraction = 1.0;
    for (var q = 0u; q < 4u; q++) {
        let s = quadrant(q);
        let o = array<vec2i, 3>(vec2i(s.x, 0), vec2i(0, s.y), s);
        var offsets: array<vec2f, 3>;
        var changes: array<vec2f, 3>;
        for (var k = 0u; k < 3u; k++) {
            offsets[k] = offset_to(n, o[k]);
            changes[k] = change(n, o[k]);
        }
        let sign = f32(s.x * s.y);
        for (var k = 0u; k < 3u; k++) {
            // The node's own corner, its x-neighbour's, its y-neighbour's.
            let i = select(0u, 2u, k == 2u);
            let j = select(1u, 2u, k == 1u);
            // At the fraction s of the step, J less the margin that must be left is q(s) = start + first s + second
            // s^2, with q(0) >= 0. If q(1) < 0, it has one root in between.
            let over = max(sign * cross2(offsets[i], offsets[j]) - MIN_JACOBIAN, 0.0);
            let start = over * (1.0 - kept);
            let first = sign * (cross2(changes[i], offsets[j]) + cross2(offsets[i], changes[j]));
            let second = sign * cross2(changes[i], changes[j]);
            if start + first + second < 0.0 {
                let root = sqrt(max(first * first - 4.0 * start * second, 0.0)) - first;
                fraction = min(fraction, (start + start) / max(root, SMALLEST));
            }
        }
    }
    return fraction;
}

/// Round `mode`: sets each node's mark to the factor by which its fraction shrinks. In the shrinking rounds it is what
/// the corners allow that lose more than all but the fraction `factor` of their margin at u + fraction x step; in the
/// last rounds, where `factor` is negative, it is 0 at corners that fall under the bound.
@compute @workgroup_size(64)
fn mark_corners(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = limited_block_of_workgroup(group, t, params.mode);
    if b == NONE {
        return;
    }
    let plane = FRACTION + (params.mode & 1u);
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].neighbours[source.x];
        window_u[k] = vec2f();
        window_step[k] = vec2f();
        if holder != NONE {
            window_u[k] = displacement(holder, source.y);
            if blocks[holder].is_active != 0u {
                window_step[k] = vectors[vector_index(holder, plane, source.y)] * step_vector(holder, source.y);
            }
        }
        if params.factor < 0.0 {
            window_u[k] += window_step[k];
        }
    }
    workgroupBarrier();
    var limited = false;
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        var mark: f32;
        if params.factor >= 0.0 {
            mark = allowed_fraction(node_at(s), params.factor);
        } else {
            // A comparison with NaN is false: a node with a Jacobian that is NaN is marked, too.
            mark = select(0.0, 1.0, worst_corner(node_at(s)) >= MIN_JACOBIAN);
        }
        vectors[vector_index(b, MARK, s)] = mark;
        limited = limited || mark < 1.0;
    }
    if limited {
        atomicMax(&charts[blocks[b].chart].limit_rounds, params.mode + 1u);
    }
}

/// Returns the block of this workgroup if its chart is still limited after `rounds` rounds, else NONE.
fn limited_block_of_workgroup(group: vec3u, t: u32, rounds: u32) -> u32 {
    let b = block_of_workgroup(group, t);
    if t == 0u && b != NONE && atomicLoad(&charts[blocks[b].chart].limit_rounds) < rounds {
        workgroup_block = NONE;
    }
    return workgroupUniformLoad(&workgroup_block);
}

fn offset_to(n: vec2u, o: vec2i) -> vec2f {
    let at = vec2u(vec2i(n) + 1 + o);
    return (window_u[place(at.x, at.y)] - window_u[place(n.x + 1u, n.y + 1u)]) + vec2f(o);
}

fn change(n: vec2u, o: vec2i) -> vec2f {
    let at = vec2u(vec2i(n) + 1 + o);
    return window_step[place(at.x, at.y)] - window_step[place(n.x + 1u, n.y + 1u)];
}

fn cross2(a: vec2f, b: vec2f) -> f32 {
    return a.x * b.y - a.y * b.x;
}

/// The smallest of the twelve corner Jacobians that depend on node n; -INVALID_ENERGY if one is NaN or infinite.
fn worst_corner(n: vec2u) -> f32 {
    var worst = INVALID_ENERGY;
    for (var q = 0u; q < 4u; q++) {
        let s = quadrant(q);
        let a = offset_to(n, vec2i(s.x, 0));
        let b = offset_to(n, vec2i(0, s.y));
        let c = offset_to(n, s);
        let sign = f32(s.x * s.y);
        let corners = sign * vec3f(cross2(a, b), cross2(a, c), cross2(c, b));
        for (var k = 0u; k < 3u; k++) {
            worst = min(worst, select(-INVALID_ENERGY, corners[k], is_finite(corners[k])));
        }
    }
    return worst;
}

/// Step fractions at the nodes from (-2, -2) to (17, 17) of a block, a wide window of 20x20, before the falloff and
/// after its first pass; 2 at nodes that are not stored.
var<workgroup> fractions: array<f32, 400>;
var<workgroup> after_first_pass: array<f32, 400>;

/// Index in `vectors` of plane `plane` of node n of block b, n from -3 to 18; NONE if the node is in no active block.
fn wide_vector_index(b: u32, plane: u32, n: vec2i) -> u32 {
    let shifted = vec2u(n + 16);
    let holder = blocks[b].active_neighbours[shifted.y / 16u * 3u + shifted.x / 16u];
    if holder == NONE {
        return NONE;
    }
    return vector_index(holder, plane, slot(shifted.x % 16u, shifted.y % 16u));
}

fn wide_node(k: u32) -> vec2i {
    return vec2i(i32(k % 20u), i32(k / 20u)) - 2;
}

/// Returns the fraction at place k of the wide window after one pass of the falloff, which limits it to the smallest
/// fraction of its neighbours plus FRACTION_FALLOFF. The pass reads `fractions`, or `after_first_pass` if `second` is
/// set.
fn after_falloff(k: u32, second: bool) -> f32 {
    let own = select(fractions[k], after_first_pass[k], second);
    if own > 1.0 {
        return own;
    }
    var low = 1.0;
    for (var i = 0u; i < 9u; i++) {
        let at = k + (i / 3u) * 20u + i % 3u - 21u;
        if i != 4u {
            low = min(low, select(fractions[at], after_first_pass[at], second));
        }
    }
    return min(own, low + FRACTION_FALLOFF);
}

/// After round `mode`: multiplies each fraction by the least mark of the node and its neighbours, and does two passes
/// of the falloff.
@compute @workgroup_size(64)
fn shrink_fractions(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = limited_block_of_workgroup(group, t, params.mode + 1u);
    if b == NONE {
        return;
    }
    for (var k = t; k < 400u; k += 64u) {
        let n = wide_node(k);
        let at = wide_vector_index(b, FRACTION + (params.mode & 1u), n);
        fractions[k] = 2.0;
        if at != NONE {
            var least = 1.0;
            for (var i = 0u; i < 9u; i++) {
                let mark_at = wide_vector_index(b, MARK, n + vec2i(i32(i % 3u), i32(i / 3u)) - 1);
                if mark_at != NONE {
                    least = min(least, vectors[mark_at]);
                }
            }
            fractions[k] = vectors[at] * least;
        }
    }
    workgroupBarrier();
    for (var k = t; k < 400u; k += 64u) {
        let n = wide_node(k);
        after_first_pass[k] = 2.0;
        if all(n > vec2i(-2)) && all(n < vec2i(17)) {
            after_first_pass[k] = after_falloff(k, false);
        }
    }
    workgroupBarrier();
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        let n = node_at(s) + 2u;
        vectors[vector_index(b, FRACTION + ((params.mode + 1u) & 1u), s)] = after_falloff(n.y * 20u + n.x, true);
    }
}
