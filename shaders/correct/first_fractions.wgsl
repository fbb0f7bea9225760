// correct: the step limit's first fractions (method §7.6). They leave every corner Jacobian a part of its margin over
// STEP_MIN_JACOBIAN. Charts whose whole step leaves enough margin are done, and need no round of the limit. Per node it
// reads 24 bytes, a quarter more for the halo, and writes 4.

var<workgroup> window_u: array<vec2f, 324>;
var<workgroup> window_step: array<vec2f, 324>;

/// The longest component of the block's step, as bits, which are ordered as the numbers are.
var<workgroup> longest: atomic<u32>;
/// The largest part of a node's step that its corners cut off, as bits.
var<workgroup> cut: atomic<u32>;

/// Sets each node's fraction of the step to the largest that its corners allow if all nodes take the same fraction. A
/// chart with a fraction under 1 is limited. Finds the chart's longest step, from which its falloff follows, and how
/// much of the step is cut off.
@compute @workgroup_size(256)
fn first_fractions(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    // Workgroup memory begins with any values.
    if t == 0u {
        atomicStore(&longest, 0u);
        atomicStore(&cut, 0u);
    }
    for (var k = t; k < WINDOW; k += NODES) {
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
    let n = vec2i(node_at(t));
    let step = abs(window_step[place_in_window(n)]);
    let fraction = allowed_fraction(n, MARGIN_LEFT);
    vectors[vector_index(b, FRACTION, t)] = fraction;
    if fraction < 1.0 {
        atomicMax(&cut, bitcast<u32>(1.0 - fraction));
        atomicMax(&charts[blocks[b].chart].limit_rounds, 1u);
    }
    atomicMax(&longest, bitcast<u32>(max(step.x, step.y)));
    workgroupBarrier();
    if t == 0u {
        atomicMax(&charts[blocks[b].chart].longest, atomicLoad(&longest));
        atomicMax(&charts[blocks[b].chart].cut, atomicLoad(&cut));
    }
}

fn place_in_window(n: vec2i) -> u32 {
    return place(u32(n.x + 1), u32(n.y + 1));
}

fn offset_to(n: vec2i, o: vec2i) -> vec2f {
    return (window_u[place_in_window(n + o)] - window_u[place_in_window(n)]) + vec2f(o);
}

fn change(n: vec2i, o: vec2i) -> vec2f {
    return window_step[place_in_window(n + o)] - window_step[place_in_window(n)];
}
