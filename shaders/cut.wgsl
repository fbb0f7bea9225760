// correct: the step's local share: 1 where the whole step keeps every corner Jacobian at epsilon or more, halved around
// corners that would fall under it, falling off smoothly around those. Charts without such corners are done.

var<workgroup> near: array<vec2f, 324>;
var<workgroup> any_fold: array<u32, 64>;

/// Marks nodes with a corner that u + share x would fold, and tells the chart.
@compute @workgroup_size(64)
fn mark(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    let first = params.mode == 0u;
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].around[source.x];
        near[k] = vec2f();
        if holder != NONE {
            near[k] = displacement(holder, source.y);
            if blocks[holder].moves != 0u {
                let x = vector_at(holder, X, source.y);
                let share = select(vectors[vector_at(holder, SHARE, source.y)], 1.0, first);
                near[k] += share * vec2f(vectors[x], vectors[x + NODES]);
            }
        }
    }
    workgroupBarrier();
    var folds = 0u;
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        let n = node_of(s);
        // What is not a number is no Jacobian either.
        let bad = !(worst_corner(n) >= MIN_JACOBIAN);
        vectors[vector_at(b, MARK, s)] = select(0.0, 1.0, bad);
        if first {
            vectors[vector_at(b, SHARE, s)] = 1.0;
        }
        folds |= u32(bad);
    }
    any_fold[t] = folds;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if t < half {
            any_fold[t] |= any_fold[t + half];
        }
        workgroupBarrier();
    }
    if t == 0u {
        partials[params.partial + group.y * SPREAD + group.x] = vec4f(f32(any_fold[0]), 0.0, 0.0, 0.0);
    }
}

fn arm(n: vec2u, o: vec2i) -> vec2f {
    let at = vec2u(vec2i(n) + 1 + o);
    return (near[place(at.x, at.y)] - near[place(n.x + 1u, n.y + 1u)]) + vec2f(o);
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

/// Shrinks the share of marked nodes and of those next to them.
@compute @workgroup_size(64)
fn shrink(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        let n = node_of(s);
        var marked = false;
        for (var i = 0u; i < 9u; i++) {
            let source = window_source(n + vec2u(i % 3u, i / 3u));
            let holder = blocks[b].links[source.x];
            if holder != NONE {
                marked = marked || vectors[vector_at(holder, MARK, source.y)] != 0.0;
            }
        }
        if marked {
            vectors[vector_at(b, SHARE, s)] *= params.part;
        }
    }
}

/// A share exceeds its neighbours' by at most this: a step that changes abruptly folds by itself.
const FALLOFF: f32 = 0.125;

/// share <= min(neighbours) + FALLOFF, from one plane into the other; mode 1: back again.
@compute @workgroup_size(64)
fn falloff(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    let source_plane = select(SHARE, SHARE_COPY, params.mode == 1u);
    let target_plane = select(SHARE_COPY, SHARE, params.mode == 1u);
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        let n = node_of(s);
        var low = 1.0;
        for (var i = 0u; i < 9u; i++) {
            let source = window_source(n + vec2u(i % 3u, i / 3u));
            let holder = blocks[b].links[source.x];
            if i != 4u && holder != NONE {
                low = min(low, vectors[vector_at(holder, source_plane, source.y)]);
            }
        }
        let own = vectors[vector_at(b, source_plane, s)];
        vectors[vector_at(b, target_plane, s)] = min(own, low + FALLOFF);
    }
}
