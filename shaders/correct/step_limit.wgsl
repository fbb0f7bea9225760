// correct: the step's local share: the part of it that leaves every corner Jacobian some of what it has over epsilon,
// falling off smoothly around corners that would lose more; what folds all the same is halved. Charts whose whole step
// leaves enough are done.

var<workgroup> near: array<vec2f, 324>;
var<workgroup> steps: array<vec2f, 324>;

/// A step leaves at least this share of what a corner Jacobian has over the bound.
const KEPT: f32 = 0.1;

/// How often a chart that is cut at all counts as cut: two falloffs come before the first round.
const CUT_AT_ALL: u32 = 2u;

/// The part of the step that each node may take, were the nodes around it to take the same; tells the chart.
@compute @workgroup_size(64)
fn parts(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].around[source.x];
        near[k] = vec2f();
        steps[k] = vec2f();
        if holder != NONE {
            near[k] = displacement(holder, source.y);
            if blocks[holder].moves != 0u {
                let x = vector_at(holder, X, source.y);
                steps[k] = vec2f(vectors[x], vectors[x + NODES]);
            }
        }
    }
    workgroupBarrier();
    var cut = false;
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        let part = part_of(node_of(s));
        vectors[vector_at(b, SHARE, s)] = part;
        vectors[vector_at(b, MARK, s)] = 0.0;
        cut = cut || part < 1.0;
    }
    if cut {
        atomicMax(&charts[blocks[b].chart].cuts, CUT_AT_ALL);
    }
}

/// Keeps a quotient finite.
const SMALLEST: f32 = 1.1754944e-38;

/// The smallest part over the twelve corners that a node touches.
fn part_of(n: vec2u) -> f32 {
    var part = 1.0;
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
            // J over what is to be left of it, at the part s of the step: start + s first + s^2 second, which starts at 0
            // or more. If it ends under 0, it has one root in between.
            let over = max(sign * cross2(arms[i], arms[j]) - MIN_JACOBIAN, 0.0);
            let start = over * (1.0 - KEPT);
            let first = sign * (cross2(changes[i], arms[j]) + cross2(arms[i], changes[j]));
            let second = sign * cross2(changes[i], changes[j]);
            if start + first + second < 0.0 {
                let root = sqrt(max(first * first - 4.0 * start * second, 0.0)) - first;
                part = min(part, (start + start) / max(root, SMALLEST));
            }
        }
    }
    return part;
}

/// Marks nodes with a corner that u + share x would fold, and tells the chart. Round `mode` of it.
@compute @workgroup_size(64)
fn mark(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose_cut(group, t, params.mode);
    if b == NONE {
        return;
    }
    let share_plane = SHARE + (params.mode & 1u);
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].around[source.x];
        near[k] = vec2f();
        if holder != NONE {
            near[k] = displacement(holder, source.y);
            if blocks[holder].moves != 0u {
                let x = vector_at(holder, X, source.y);
                near[k] += vectors[vector_at(holder, share_plane, source.y)] * vec2f(vectors[x], vectors[x + NODES]);
            }
        }
    }
    workgroupBarrier();
    var folds = false;
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        // What is not a number is no Jacobian either.
        let bad = !(worst_corner(node_of(s)) >= MIN_JACOBIAN);
        vectors[vector_at(b, MARK, s)] = select(0.0, 1.0, bad);
        folds = folds || bad;
    }
    if folds {
        atomicMax(&charts[blocks[b].chart].cuts, params.mode + 1u);
    }
}

/// The block of this workgroup if its chart has been cut so often, NONE otherwise.
fn choose_cut(group: vec3u, t: u32, cuts: u32) -> u32 {
    let b = choose(group, t);
    if t == 0u && b != NONE && atomicLoad(&charts[blocks[b].chart].cuts) < cuts {
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

/// The smallest of the twelve corner Jacobians that a node touches; less than any if one is not a number.
fn worst_corner(n: vec2u) -> f32 {
    var worst = WORTHLESS;
    for (var q = 0u; q < 4u; q++) {
        let s = quadrant(q);
        let a = arm(n, vec2i(s.x, 0));
        let b = arm(n, vec2i(0, s.y));
        let c = arm(n, s);
        let sign = f32(s.x * s.y);
        let corners = sign * vec3f(cross2(a, b), cross2(a, c), cross2(c, b));
        for (var k = 0u; k < 3u; k++) {
            worst = min(worst, select(-WORTHLESS, corners[k], is_number(corners[k])));
        }
    }
    return worst;
}

/// A share exceeds its neighbours' by at most this: a step that changes abruptly folds by itself.
const FALLOFF: f32 = 0.125;

/// Shares at the nodes (-2..17) of a block; over 1 where no share is kept.
var<workgroup> shares: array<f32, 400>;
var<workgroup> lower: array<f32, 400>;

/// Place in `vectors` of a plane of node n of a block, n from -3 to 18; NONE where there is nothing.
fn wide_at(b: u32, plane: u32, n: vec2i) -> u32 {
    let shifted = vec2u(n + 16);
    let holder = blocks[b].links[shifted.y / 16u * 3u + shifted.x / 16u];
    if holder == NONE {
        return NONE;
    }
    return vector_at(holder, plane, slot(shifted.x % 16u, shifted.y % 16u));
}

fn wide_node(k: u32) -> vec2i {
    return vec2i(i32(k % 20u), i32(k / 20u)) - 2;
}

/// The share of node n after one pass of share <= min(neighbours) + FALLOFF over `from_lower` or `shares`.
fn fallen(k: u32, from_lower: bool) -> f32 {
    let own = select(shares[k], lower[k], from_lower);
    if own > 1.0 {
        return own;
    }
    var low = 1.0;
    for (var i = 0u; i < 9u; i++) {
        let at = k + (i / 3u) * 20u + i % 3u - 21u;
        if i != 4u {
            low = min(low, select(shares[at], lower[at], from_lower));
        }
    }
    return min(own, low + FALLOFF);
}

/// Shrinks the share of marked nodes and of those next to them, and lets it fall off around them. After round `mode`.
@compute @workgroup_size(64)
fn shrink(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose_cut(group, t, params.mode + 1u);
    if b == NONE {
        return;
    }
    for (var k = t; k < 400u; k += 64u) {
        let n = wide_node(k);
        let at = wide_at(b, SHARE + (params.mode & 1u), n);
        shares[k] = 2.0;
        if at != NONE {
            var marked = false;
            for (var i = 0u; i < 9u; i++) {
                let mark_at = wide_at(b, MARK, n + vec2i(i32(i % 3u), i32(i / 3u)) - 1);
                if mark_at != NONE {
                    marked = marked || vectors[mark_at] != 0.0;
                }
            }
            shares[k] = vectors[at] * select(1.0, params.part, marked);
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
        vectors[vector_at(b, SHARE + ((params.mode + 1u) & 1u), s)] = fallen(n.y * 20u + n.x, true);
    }
}
