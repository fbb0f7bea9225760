// correct: the smoother inside one block, and products with the matrix there (method §7.4). Each node has a thread, so
// that its row stays in registers: in a sweep the threads of the other colours wait. The kernel that includes this file
// declares `active_neighbour` and `vector`.

/// z at the nodes of a block and its halo.
var<workgroup> window_z: array<vec2f, 324>;

fn place_of_slot(s: u32) -> u32 {
    let n = node_at(s);
    return place(n.x + 1u, n.y + 1u);
}

/// Loads the vector in planes `plane` at the nodes of block b and its halo; 0 at nodes of inactive blocks.
fn load_window(b: u32, t: u32, plane: u32) {
    for (var k = t; k < WINDOW; k += NODES) {
        let source = window_source(window_node(k));
        let holder = active_neighbour(b, source.x);
        window_z[k] = vec2f();
        if holder != NONE {
            window_z[k] = vector(holder, plane, source.y);
        }
    }
    workgroupBarrier();
}

fn clear_window(t: u32) {
    for (var k = t; k < WINDOW; k += NODES) {
        window_z[k] = vec2f();
    }
    workgroupBarrier();
}

/// The sum of A_pn z_n over the neighbours of the node in this place of the window.
fn row_times(row: NodeRow, at: u32) -> vec2f {
    var sum = pair_times(row.pair_0, window_z[at + 1u]);
    sum += pair_times(row.pair_1, window_z[at + 18u]);
    sum += pair_times(row.pair_2, window_z[at + 19u]);
    sum += pair_times(row.pair_3, window_z[at + 17u]);
    sum += pair_times(row.pair_4, window_z[at - 1u]);
    sum += pair_times(row.pair_5, window_z[at - 18u]);
    sum += pair_times(row.pair_6, window_z[at - 19u]);
    return sum + pair_times(row.pair_7, window_z[at - 17u]);
}

/// A z at the node of this thread.
fn times_window(row: NodeRow, t: u32) -> vec2f {
    let at = place_of_slot(t);
    return row_times(row, at) + diagonal_times(row.diagonal, window_z[at]);
}

/// Gauss-Seidel sweeps of z towards A z = `right` over the node colours of a block, whose halo stays frozen. A fixed
/// node has a right-hand side of 0 and no pairs, so it stays at 0.
fn sweep_block(row: NodeRow, right: vec2f, t: u32, sweeps: u32, backwards: bool) {
    let at = place_of_slot(t);
    let inverse = inverse_of(row.diagonal);
    let turn = select(t / 64u, 3u - t / 64u, backwards);
    for (var step = 0u; step < 4u * sweeps; step++) {
        if (step & 3u) == turn {
            window_z[at] = diagonal_times(inverse, right - row_times(row, at));
        }
        workgroupBarrier();
    }
}
