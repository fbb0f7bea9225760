// correct: what the kernels of the V-cycle on finer levels share (method §7.4), on the stored rows. The smoother is
// additive over blocks: each block is smoothed with its halo frozen, independently of the others, so a pass over a
// level is one dispatch. Per node a pass reads 44 bytes of rows and 16 of vectors (up to a quarter more for the halo),
// and writes 8.

fn active_neighbour(b: u32, k: u32) -> u32 {
    return blocks[b].active_neighbours[k];
}

fn vector(b: u32, plane: u32, s: u32) -> vec2f {
    let at = vector_index(b, plane, s);
    if plane == LAST_STEP {
        return decode_vector(vectors[at]);
    }
    return vec2f(vectors[at], vectors[at + NODES]);
}

fn set_vector(b: u32, plane: u32, s: u32, v: vec2f) {
    let at = vector_index(b, plane, s);
    vectors[at] = v.x;
    vectors[at + NODES] = v.y;
}

/// Smooths z of block b from 0, with 0 around it, and stores it.
fn smooth_from_zero(b: u32, row: NodeRow, right: vec2f, t: u32) {
    clear_window(t);
    sweep_block(row, right, t, params.sweeps, false);
    set_vector(b, SMOOTHED, t, window_z[place_of_slot(t)]);
}

/// The weights ω of the lower neighbours (method §7.5) at the nodes from (-2, -1) to (16, 16), in rows of 19.
var<workgroup> weights: array<f32, 342>;

fn load_weights(b: u32, t: u32) {
    for (var k = t; k < 342u; k += NODES) {
        let shifted = vec2u(vec2i(i32(k % 19u) - 2, i32(k / 19u) - 1) + 16);
        let holder = blocks[b].active_neighbours[shifted.y / 16u * 3u + shifted.x / 16u];
        weights[k] = 0.0;
        if holder != NONE {
            weights[k] = interpolation_weight_at(holder, slot(shifted.x % 16u, shifted.y % 16u));
        }
    }
    workgroupBarrier();
}

fn weight_at(n: vec2i) -> f32 {
    return weights[u32((n.y + 1) * 19 + n.x + 2)];
}
