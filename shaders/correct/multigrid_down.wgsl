// correct: the V-cycle on the way to coarser levels (method §7.4): smoothing from z = 0, and the resulting
// contributions to the coarser level's right-hand side. On the corrected level r is already stored; on the other levels
// it is first gathered from the contributions of the finer level's blocks. It reads 44 bytes of rows, 8 of r (or 13 of
// contributions and 4 of constants, and writes 8) and 1 of weights per node, and writes 8 of z and 3 of contributions.

@group(0) @binding(10) var<storage, read> contributed: array<vec2f>;

fn stored_neighbour(b: u32, k: u32) -> u32 {
    return blocks[b].neighbours[k];
}

@compute @workgroup_size(256)
fn multigrid_down(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    var right: vec2f;
    if params.mode == DOWN_GATHER {
        right = select(arrived(b, vec2i(node_at(t))), vec2f(), is_fixed(b, t));
        set_vector(b, RESIDUAL, t, right);
    } else {
        right = vector(b, RESIDUAL, t);
    }
    let row = load_row(b, t);
    smooth_from_zero(b, row, right, t);
    load_weights(b, t);
    contribute(b, row, right, t);
}
