// correct: the smoother of the preconditioner, and products with the matrix (method §7.4), on the stored rows. The
// smoother is additive over blocks: each block is smoothed with its halo frozen, independently of the others, so a pass
// over a level is one dispatch. Each node has a thread, so that its row stays in registers: the threads of the other
// colours wait. Per node a pass reads 44 bytes of rows and 16 of vectors (up to a quarter more for the halo), and writes 8.

var<workgroup> window_z: array<vec2f, 324>;

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

fn place_of_slot(s: u32) -> u32 {
    let n = node_at(s);
    return place(n.x + 1u, n.y + 1u);
}

/// Loads the vector in planes `plane` at the nodes of block b and its halo; 0 at nodes of inactive blocks.
fn load_window(b: u32, t: u32, plane: u32) {
    for (var k = t; k < WINDOW; k += NODES) {
        let source = window_source(window_node(k));
        let holder = blocks[b].active_neighbours[source.x];
        window_z[k] = vec2f();
        if holder != NONE {
            window_z[k] = vector(holder, plane, source.y);
        }
    }
    workgroupBarrier();
}

/// A z at the node of this thread, where the window holds z.
fn times_window(row: NodeRow, t: u32) -> vec2f {
    return row_times(row, node_at(t), 0u) + diagonal_times(row, window_z[place_of_slot(t)]);
}

/// Gauss-Seidel sweeps of z towards A z = `right` over the node colours of a block. The window holds z; its halo stays
/// frozen.
fn sweep_block(row: NodeRow, right: vec2f, t: u32, backwards: bool) {
    let n = node_at(t);
    for (var sweep = 0u; sweep < 4u * params.sweeps; sweep++) {
        if t / 64u == select(sweep & 3u, 3u - (sweep & 3u), backwards) { // model: 1 times in 1 of 4 warps
            window_z[place_of_slot(t)] = solve_diagonal(row, right - row_times(row, n, 0u));
        }
        workgroupBarrier();
    }
}

/// Smooths z of block b from 0, with 0 around it, and stores it.
fn smooth_from_zero(b: u32, row: NodeRow, right: vec2f, t: u32) {
    for (var k = t; k < WINDOW; k += NODES) {
        window_z[k] = vec2f();
    }
    workgroupBarrier();
    sweep_block(row, right, t, false);
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
