// correct: the passes of the step limit (method §7.6) on fractions below 1. First they fall off smoothly around the
// corners that limit them; then rounds shrink them at corners that would still lose too much. Each dispatch reads one
// of two planes of fractions and writes the other one. A round computes the marks of its halo itself, so that it needs
// no second dispatch. Per node, without the halo of four nodes, `falloff` reads 4 bytes and writes 4; `shrink` reads 28
// and writes 4.

/// A block with a halo of four nodes: the nodes from (-4, -4) to (19, 19), row by row.
const SIDE: u32 = 24u;
const PLACES: u32 = 576u;

var<workgroup> wide_u: array<vec2f, 576>;
var<workgroup> wide_step: array<vec2f, 576>;
/// Fractions of the step; 2 at nodes outside active blocks.
var<workgroup> fractions: array<f32, 576>;
/// The factors by which a round shrinks fractions; then the fractions after every other pass of the falloff.
var<workgroup> marks: array<f32, 576>;

fn node_of(k: u32) -> vec2i {
    return vec2i(i32(k % SIDE), i32(k / SIDE)) - 4;
}

fn place_of(n: vec2i) -> u32 {
    return u32((n.y + 4) * i32(SIDE) + n.x + 4);
}

/// True if node n lies within `margin` nodes of the block.
fn is_within(n: vec2i, margin: i32) -> bool {
    return all(n >= vec2i(-margin)) && all(n <= vec2i(15 + margin));
}

/// Which of the 3x3 neighbour blocks holds node n, and the slot of the node there.
fn wide_source(n: vec2i) -> vec2u {
    let shifted = vec2u(n + 16);
    return vec2u(shifted.y / 16u * 3u + shifted.x / 16u, slot(shifted.x % 16u, shifted.y % 16u));
}

fn offset_to(n: vec2i, o: vec2i) -> vec2f {
    return (wide_u[place_of(n + o)] - wide_u[place_of(n)]) + vec2f(o);
}

fn change(n: vec2i, o: vec2i) -> vec2f {
    return wide_step[place_of(n + o)] - wide_step[place_of(n)];
}

/// Returns the block of this workgroup if its chart was limited by all of the preceding `params.mode` dispatches,
/// otherwise NONE.
fn limited_block_of_workgroup(group: vec3u, t: u32) -> u32 {
    let b = block_of_workgroup(group, t);
    if t == 0u && b != NONE && atomicLoad(&charts[blocks[b].chart].limit_rounds) < max(params.mode, 1u) {
        workgroup_block = NONE;
    }
    return workgroupUniformLoad(&workgroup_block);
}

fn load_fractions(b: u32, t: u32) {
    for (var k = t; k < PLACES; k += 64u) {
        let source = wide_source(node_of(k));
        let holder = blocks[b].active_neighbours[source.x];
        fractions[k] = 2.0;
        if holder != NONE {
            fractions[k] = vectors[vector_index(holder, FRACTION + (params.mode & 1u), source.y)];
        }
    }
    workgroupBarrier();
}

/// A pass of the falloff, which limits each fraction to the smallest one of its neighbours plus FRACTION_FALLOFF, for the
/// nodes within `margin` nodes of the block: from `fractions` to `marks`, or with `back` the other way.
fn fall_off(t: u32, margin: i32, back: bool) {
    for (var k = t; k < PLACES; k += 64u) {
        if !is_within(node_of(k), margin) {
            continue;
        }
        var low = 1.0;
        for (var i = 0u; i < 9u; i++) {
            let at = k + (i / 3u) * SIDE + i % 3u - (SIDE + 1u);
            if i != 4u {
                low = min(low, select(fractions[at], marks[at], back));
            }
        }
        let own = select(fractions[k], marks[k], back);
        let fraction = select(min(own, low + FRACTION_FALLOFF), own, own > 1.0);
        if back {
            fractions[k] = fraction;
        } else {
            marks[k] = fraction;
        }
    }
    workgroupBarrier();
}

/// Writes the fractions of the block's own nodes to the other plane.
fn store_fractions(b: u32, t: u32) {
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        vectors[vector_index(b, FRACTION + ((params.mode + 1u) & 1u), s)] = fractions[place_of(vec2i(node_at(s)))];
    }
}

/// The first passes of the falloff; `mode` is 0.
@compute @workgroup_size(64)
fn falloff(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = limited_block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_fractions(b, t);
    for (var pass_number = 0u; pass_number < FIRST_FALLOFF_PASSES; pass_number++) {
        fall_off(t, i32(FIRST_FALLOFF_PASSES - 1u - pass_number), (pass_number & 1u) != 0u);
    }
    store_fractions(b, t);
}

/// Round `mode`, from 1 on. In the shrinking rounds, a corner must keep the fraction `factor` of its margin at u +
/// fraction x step, and the mark of a node is the least factor that its corners allow. In the last rounds, where
/// `factor` is negative, the mark is 0 at corners that fall below the bound. Each fraction is multiplied by the least
/// mark of the node and its neighbours, then come two passes of the falloff. If no node of a chart is marked, the
/// fractions from before the round remain valid.
@compute @workgroup_size(64)
fn shrink(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = limited_block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_fractions(b, t);
    for (var k = t; k < PLACES; k += 64u) {
        let source = wide_source(node_of(k));
        let holder = blocks[b].neighbours[source.x];
        wide_u[k] = vec2f();
        wide_step[k] = vec2f();
        if holder != NONE {
            wide_u[k] = displacement(holder, source.y);
            if blocks[holder].is_active != 0u {
                wide_step[k] = fractions[k] * step_vector(holder, source.y);
            }
        }
        if params.factor < 0.0 {
            wide_u[k] += wide_step[k];
        }
    }
    workgroupBarrier();
    var limited = false;
    for (var k = t; k < PLACES; k += 64u) {
        let n = node_of(k);
        var mark = 1.0;
        if is_within(n, 3) && !(fractions[k] > 1.0) {
            if params.factor >= 0.0 {
                mark = allowed_fraction(n, params.factor);
            } else {
                // Any comparison with NaN is false, so a node whose Jacobian is NaN is marked, too.
                mark = select(0.0, 1.0, worst_corner(n) >= MIN_JACOBIAN);
            }
        }
        marks[k] = mark;
        limited = limited || (mark < 1.0 && is_within(n, 0));
    }
    if limited {
        atomicMax(&charts[blocks[b].chart].limit_rounds, params.mode + 1u);
    }
    workgroupBarrier();
    for (var k = t; k < PLACES; k += 64u) {
        if is_within(node_of(k), 2) && !(fractions[k] > 1.0) {
            var least = 1.0;
            for (var i = 0u; i < 9u; i++) {
                least = min(least, marks[k + (i / 3u) * SIDE + i % 3u - (SIDE + 1u)]);
            }
            fractions[k] *= least;
        }
    }
    workgroupBarrier();
    fall_off(t, 1, false);
    fall_off(t, 0, true);
    store_fractions(b, t);
}
