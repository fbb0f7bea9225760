// correct: the step limit (method §7.6): the fraction of the step that each node takes. It leaves every corner Jacobian part
// of what it has over MIN_JACOBIAN, and falls off smoothly around corners that would lose more; what folds all the same is
// halved. Charts whose whole step leaves enough are done.

var<workgroup> near: array<vec2f, 324>;
var<workgroup> steps: array<vec2f, 324>;

/// The first round that looks for folds: dispatches of the falloff come before it.
const FIRST_HALVING_ROUND: u32 = FIRST_FALLOFF_PASSES / FALLOFF_PASSES;

/// The fraction of the step that each node may take if the nodes around it take the same. A chart for which it is not 1
/// everywhere is limited.
@compute @workgroup_size(64)
fn first_fractions(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].neighbours[source.x];
        near[k] = vec2f();
        steps[k] = vec2f();
        if holder != NONE {
            near[k] = displacement(holder, source.y);
            if blocks[holder].is_active != 0u {
                let x = vector_at(holder, STEP, source.y);
                steps[k] = vec2f(vectors[x], vectors[x + NODES]);
            }
        }
    }
    workgroupBarrier();
    var limited = false;
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        let fraction = first_fraction(node_of(s));
        vectors[vector_at(b, FRACTION, s)] = fraction;
        vectors[vector_at(b, MARK, s)] = 0.0;
        limited = limited || fraction < 1.0;
    }
    if limited {
        atomicMax(&charts[blocks[b].chart].limit_rounds, FIRST_HALVING_ROUND);
    }
}

/// Keeps a quotient finite.
const SMALLEST: f32 = 1.1754944e-38;

/// The smallest fraction over the twelve corners that a node touches.
fn first_fraction(n: vec2u) -> f32 {
    var fraction = 1.0;
    for (var q = 0u; q < 4u; q++) {
        let s = quadrant(q);
        let o = array<vec2i, 3>(vec2i(s.x, 0), vec2i(0, s.y), s);
        var arms: array<vec2f, 3>;
        var changes: array<vec2f, 3>;
        for (var k = 0u; k < 3u; k++) {
            arms[k] = arm(n, o[k]);
            changes[k] = change(n, o[k]);
        }
        let sign = f32(s.x * s.y);
        for (var k = 0u; k < 3u; k++) {
            // The node's own corner, its x-neighbour's, its y-neighbour's.
            let i = select(0u, 2u, k == 2u);
            let j = select(1u, 2u, k == 1u);
            // At the fraction s of the step, J less what is to be left of it is start + s first + s^2 second, which is at
            // least 0 for s = 0. If it is under 0 for s = 1, it has one root in between.
            let over = max(sign * cross2(arms[i], arms[j]) - MIN_JACOBIAN, 0.0);
            let start = over * (1.0 - KEPT_MARGIN);
            let first = sign * (cross2(changes[i], arms[j]) + cross2(arms[i], changes[j]));
            let second = sign * cross2(changes[i], changes[j]);
            if start + first + second < 0.0 {
                let root = sqrt(max(first * first - 4.0 * start * second, 0.0)) - first;
                fraction = min(fraction, (start + start) / max(root, SMALLEST));
            }
        }
    }
    return fraction;
}

/// Round `mode`: marks nodes with a corner that u + fraction x step would take under the bound.
@compute @workgroup_size(64)
fn mark_folds(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose_limited(group, t, params.mode);
    if b == NONE {
        return;
    }
    let plane = FRACTION + (params.mode & 1u);
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].neighbours[source.x];
        near[k] = vec2f();
        if holder != NONE {
            near[k] = displacement(holder, source.y);
            if blocks[holder].is_active != 0u {
                let x = vector_at(holder, STEP, source.y);
                near[k] += vectors[vector_at(holder, plane, source.y)] * vec2f(vectors[x], vectors[x + NODES]);
            }
        }
    }
    workgroupBarrier();
    var folds = false;
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        // A comparison with NaN is false: then, too, the node is marked.
        let bad = !(worst_corner(node_of(s)) >= MIN_JACOBIAN);
        vectors[vector_at(b, MARK, s)] = select(0.0, 1.0, bad);
        folds = folds || bad;
    }
    if folds {
        atomicMax(&charts[blocks[b].chart].limit_rounds, params.mode + 1u);
    }
}

/// The block of this workgroup if its chart is still limited in this round, NONE otherwise.
fn choose_limited(group: vec3u, t: u32, rounds: u32) -> u32 {
    let b = choose(group, t);
    if t == 0u && b != NONE && atomicLoad(&charts[blocks[b].chart].limit_rounds) < rounds {
        chosen = NONE;
    }
    return workgroupUniformLoad(&chosen);
}

fn arm(n: vec2u, o: vec2i) -> vec2f {
    let at = vec2u(vec2i(n) + 1 + o);
    return (near[place(at.x, at.y)] - near[place(n.x + 1u, n.y + 1u)]) + vec2f(o);
}

fn change(n: vec2u, o: vec2i) -> vec2f {
    let at = vec2u(vec2i(n) + 1 + o);
    return steps[place(at.x, at.y)] - steps[place(n.x + 1u, n.y + 1u)];
}

fn cross2(a: vec2f, b: vec2f) -> f32 {
    return a.x * b.y - a.y * b.x;
}

/// The smallest of the twelve corner Jacobians that a node touches; less than any if one is NaN or infinite.
fn worst_corner(n: vec2u) -> f32 {
    var worst = INVALID_ENERGY;
    for (var q = 0u; q < 4u; q++) {
        let s = quadrant(q);
        let a = arm(n, vec2i(s.x, 0));
        let b = arm(n, vec2i(0, s.y));
        let c = arm(n, s);
        let sign = f32(s.x * s.y);
        let corners = sign * vec3f(cross2(a, b), cross2(a, c), cross2(c, b));
        for (var k = 0u; k < 3u; k++) {
            worst = min(worst, select(-INVALID_ENERGY, corners[k], is_number(corners[k])));
        }
    }
    return worst;
}

/// Fractions at the nodes (-2..17) of a block; over 1 where none is stored.
var<workgroup> fractions: array<f32, 400>;
var<workgroup> lower: array<f32, 400>;

/// Place in `vectors` of a plane of node n of a block, n from -3 to 18; NONE where there is nothing.
fn wide_at(b: u32, plane: u32, n: vec2i) -> u32 {
    let shifted = vec2u(n + 16);
    let holder = blocks[b].active_neighbours[shifted.y / 16u * 3u + shifted.x / 16u];
    if holder == NONE {
        return NONE;
    }
    return vector_at(holder, plane, slot(shifted.x % 16u, shifted.y % 16u));
}

fn wide_node(k: u32) -> vec2i {
    return vec2i(i32(k % 20u), i32(k / 20u)) - 2;
}

/// The fraction of a node after one pass of fraction <= min(fractions around) + FRACTION_FALLOFF over `lower` or
/// `fractions`.
fn fallen(k: u32, from_lower: bool) -> f32 {
    let own = select(fractions[k], lower[k], from_lower);
    if own > 1.0 {
        return own;
    }
    var low = 1.0;
    for (var i = 0u; i < 9u; i++) {
        let at = k + (i / 3u) * 20u + i % 3u - 21u;
        if i != 4u {
            low = min(low, select(fractions[at], lower[at], from_lower));
        }
    }
    return min(own, low + FRACTION_FALLOFF);
}

/// After round `mode`: takes `factor` of the fraction of marked nodes and of those next to them, and lets it fall off around
/// them.
@compute @workgroup_size(64)
fn shrink_fractions(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose_limited(group, t, params.mode + 1u);
    if b == NONE {
        return;
    }
    for (var k = t; k < 400u; k += 64u) {
        let n = wide_node(k);
        let at = wide_at(b, FRACTION + (params.mode & 1u), n);
        fractions[k] = 2.0;
        if at != NONE {
            var marked = false;
            for (var i = 0u; i < 9u; i++) {
                let mark_at = wide_at(b, MARK, n + vec2i(i32(i % 3u), i32(i / 3u)) - 1);
                if mark_at != NONE {
                    marked = marked || vectors[mark_at] != 0.0;
                }
            }
            fractions[k] = vectors[at] * select(1.0, params.factor, marked);
        }
    }
    workgroupBarrier();
    for (var k = t; k < 400u; k += 64u) {
        let n = wide_node(k);
        lower[k] = 2.0;
        if all(n > vec2i(-2)) && all(n < vec2i(17)) {
            lower[k] = fallen(k, false);
        }
    }
    workgroupBarrier();
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        let n = node_of(s) + 2u;
        vectors[vector_at(b, FRACTION + ((params.mode + 1u) & 1u), s)] = fallen(n.y * 20u + n.x, true);
    }
}
