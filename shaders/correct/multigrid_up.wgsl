// correct: the V-cycle on the way back from a coarser level (method §7.4): P z of the coarser level is added to the
// smoothed z at the block and its halo, followed by the backward sweeps. On the corrected level this is also where the
// preconditioned vector is used: the first time for r . z, the second time, where the right-hand side is A z0, for the
// second preconditioned residual z1 and its products (method §7.3). It reads 44 bytes of rows, 16 of vectors (24 the
// second time), 5 of constants and 2 of the coarser level per node, and writes 8.

@group(0) @binding(10) var<storage, read> coarse_vectors: array<f32>;

/// z of the coarser level at the 10x10 coarse nodes over and around the block.
var<workgroup> coarse_z: array<vec2f, 100>;

fn load_coarse_z(b: u32, t: u32) {
    let quarter = vec2i(vec2u(blocks[b].x & 1u, blocks[b].y & 1u)) * 8;
    for (var k = t; k < 100u; k += NODES) {
        let n = quarter + vec2i(i32(k % 10u), i32(k / 10u)) - 1;
        let beyond = vec2u((n < vec2i(0)) | (n > vec2i(15)));
        let side = beyond.y * 2u + beyond.x;
        coarse_z[k] = vec2f();
        // Inactive blocks have no z; their memory may hold other quantities.
        if ((blocks[b].active_parents >> side) & 1u) != 0u && params.has_coarser == 1u {
            let holder = blocks[b].parents[side];
            let at = (holder * VECTOR_PLANES + DIRECTION) * NODES + slot(u32(n.x & 15), u32(n.y & 15));
            coarse_z[k] = vec2f(coarse_vectors[at], coarse_vectors[at + NODES]);
        }
    }
    workgroupBarrier();
}

fn coarse_at(n: vec2i) -> vec2f {
    return coarse_z[u32((n.y + 2) / 2 * 10 + (n.x + 2) / 2)];
}

/// z of the coarser level, interpolated in y, at node n in a coarse column.
fn interpolated_in_y(n: vec2i) -> vec2f {
    if (n.y & 1) == 0 {
        return coarse_at(n);
    }
    let weight = weight_at(n);
    return coarse_at(n - vec2i(0, 1)) * weight + coarse_at(n + vec2i(0, 1)) * (1.0 - weight);
}

/// P z of the coarser level at node n, from (-1, -1) to (16, 16), which must be movable.
fn interpolated(n: vec2i) -> vec2f {
    if (n.x & 1) == 0 {
        return interpolated_in_y(n);
    }
    let weight = weight_at(n);
    return interpolated_in_y(n - vec2i(1, 0)) * weight + interpolated_in_y(n + vec2i(1, 0)) * (1.0 - weight);
}

@compute @workgroup_size(256)
fn multigrid_up(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_weights(b, t);
    load_coarse_z(b, t);
    let row = load_row(b, t);
    var right: vec2f;
    if params.mode == UP_SECOND {
        load_window(b, t, DIRECTION);
        right = times_window(row, t);
        workgroupBarrier();
    } else {
        right = vector(b, RESIDUAL, t);
    }
    for (var k = t; k < WINDOW; k += NODES) {
        let node = window_node(k);
        let source = window_source(node);
        let holder = blocks[b].active_neighbours[source.x];
        window_z[k] = vec2f();
        if holder != NONE && !is_fixed(holder, source.y) {
            window_z[k] = vector(holder, SMOOTHED, source.y) + interpolated(vec2i(node) - 1);
        }
    }
    workgroupBarrier();
    sweep_block(row, right, t, params.sweeps, true);
    let z = window_z[place_of_slot(t)];
    if params.mode == UP_SECOND {
        second_residual(b, right, z, t, group);
        return;
    }
    // With a pull, the energy from assembly is incomplete. It is stored in the memory of this thread's first z.
    if params.mode == UP_FIRST && t == 0u && params.pull == 0.0 {
        partials[sum_index(SUM_ENERGY, group.y * SPREAD + group.x)] =
            vectors[vector_index(b, ENERGY_BEFORE, 0u)];
    }
    set_vector(b, DIRECTION, t, z);
    if params.mode == UP_FIRST {
        write_sum(group, t, SUM_RZ, dot(right, z));
    }
}

/// Replaces r by z1 = z0 - alpha M A z0, and sums r1 . z1, z1 . A z0 and perhaps r1 . p, with r1 = r - alpha A z0 and
/// the last step p. `product` is A z0 and `smoothed` is M A z0 at this thread's node.
fn second_residual(b: u32, product: vec2f, smoothed: vec2f, t: u32, group: vec3u) {
    let alpha = charts[blocks[b].chart].alpha;
    var r = vector(b, RESIDUAL, t);
    var z = vector(b, DIRECTION, t);
    // A step of length 0 leaves both unchanged, even where the product is NaN.
    if alpha != 0.0 {
        r -= alpha * product;
        z -= alpha * smoothed;
    }
    set_vector(b, RESIDUAL, t, z);
    write_sum(group, t, SUM_RZ_SECOND, dot(r, z));
    workgroupBarrier();
    write_sum(group, t, SUM_PRODUCT_Z_SECOND, dot(product, z));
    if params.has_last_step == 1u {
        workgroupBarrier();
        write_sum(group, t, SUM_LAST_RESIDUAL, dot(r, vector(b, LAST_STEP, t)));
    }
}
