// correct: a round of the step limit (method §7.6), which shrinks fractions at corners that would still lose too much.
// It reads one of two planes of fractions and writes the other one, and computes the marks of its halo itself, so that
// it needs no second dispatch. Per node, without the halo of two nodes, it reads 28 bytes and writes 4.

/// A block with a halo of two nodes: the nodes from (-2, -2) to (17, 17), row by row.
const SIDE: u32 = 20u;
const PLACES: u32 = 400u;

var<workgroup> wide_u: array<vec2f, 400>;
var<workgroup> wide_step: array<vec2f, 400>;
/// Fractions of the step; 2 at nodes outside active blocks.
var<workgroup> fractions: array<f32, 400>;
/// The factors by which the round shrinks fractions.
var<workgroup> marks: array<f32, 400>;

fn node_of(k: u32) -> vec2i {
    return vec2i(i32(k % SIDE), i32(k / SIDE)) - 2;
}

fn place_of(n: vec2i) -> u32 {
    return u32((n.y + 2) * i32(SIDE) + n.x + 2);
}

/// True if node n lies within `margin` nodes of the block.
fn is_within(n: vec2i, margin: i32) -> bool {
    return all(n >= vec2i(-margin)) && all(n <= vec2i(15 + margin));
}

/// Number of the 3x3 neighbour block that holds node n, and the slot of the node there.
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

/// Round `mode`, from 1 on, for charts that were limited by all dispatches before it. In the shrinking rounds, a corner
/// must keep the fraction `factor` of its margin at u + fraction x step, and the mark of a node is the least factor
/// that its corners allow. In the last rounds, where `factor` is negative, the mark is 0 at corners that fall below the
/// bound. Each fraction is multiplied by the least mark of the node and its neighbours. If no node of a chart is
/// marked, the fractions from before the round remain valid.
@compute @workgroup_size(256)
fn shrink(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let block = block_of_workgroup(group, t);
    if t == 0u && block != NONE && atomicLoad(&charts[blocks[block].chart].limit_rounds) < params.mode {
        workgroup_block = NONE;
    }
    let b = workgroupUniformLoad(&workgroup_block);
    if b == NONE {
        return;
    }
    for (var k = t; k < PLACES; k += NODES) {
        let source = wide_source(node_of(k));
        let holder = blocks[b].neighbours[source.x];
        fractions[k] = 2.0;
        wide_u[k] = vec2f();
        wide_step[k] = vec2f();
        if holder != NONE {
            wide_u[k] = displacement(holder, source.y);
            if blocks[holder].is_active != 0u {
                fractions[k] = vectors[vector_index(holder, FRACTION + ((params.mode + 1u) & 1u), source.y)];
                wide_step[k] = fractions[k] * step_vector(holder, source.y);
            }
        }
        if params.factor < 0.0 {
            wide_u[k] += wide_step[k];
        }
    }
    workgroupBarrier();
    var limited = false;
    for (var k = t; k < PLACES; k += NODES) {
        let n = node_of(k);
        var mark = 1.0;
        if is_within(n, 1) && !(fractions[k] > 1.0) {
            if params.factor >= 0.0 {
                mark = allowed_fraction(n, params.factor);
            } else {
                // Any comparison with NaN is false, so a node whose Jacobian is NaN is marked, too.
                mark = select(0.0, 1.0, worst_corner(n) >= STEP_MIN_JACOBIAN);
            }
        }
        marks[k] = mark;
        limited = limited || (mark < 1.0 && is_within(n, 0));
    }
    if limited {
        atomicMax(&charts[blocks[b].chart].limit_rounds, params.mode + 1u);
    }
    workgroupBarrier();
    let at = place_of(vec2i(node_at(t)));
    var least = 1.0;
    for (var i = 0u; i < 9u; i++) {
        least = min(least, marks[at + (i / 3u) * SIDE + i % 3u - (SIDE + 1u)]);
    }
    vectors[vector_index(b, FRACTION + (params.mode & 1u), t)] = fractions[at] * least;
}
