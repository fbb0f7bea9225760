// correct: products with the matrix for conjugate gradients (method §7.3). Their scalars are formed chart by chart,
// from sums per block, and are stored in `charts` (control.wgsl). `product` reads 44 bytes of rows, 8 of vectors (a
// quarter more for the halo) and 1 of weights per node, and writes 8 and 3 of contributions; `curvature` reads 44 and
// 8, and 12 more where the last step is a direction.

/// z0 . A z0, and the start of the second V-cycle with A z0 while the rows are in memory. The V-cycle is linear, so its
/// output for the next residual follows from its output for A z0, before the length of the first step is known. A z0 is
/// not stored: the way back computes it again.
@compute @workgroup_size(256)
fn product(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    let row = load_row(b, t);
    load_window(b, t, DIRECTION);
    let product = times_window(row, t);
    write_sum(group, t, SUM_Z_PRODUCT, dot(window_z[place_of_slot(t)], product));
    smooth_from_zero(b, row, product, t);
    load_weights(b, t);
    contribute(b, row, product, t);
}

/// z1 . A z1, where z1 has replaced r; and the products of A p with z0, z1 and p, if the last step p is a direction.
@compute @workgroup_size(256)
fn curvature(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_window(b, t, RESIDUAL);
    let row = load_row(b, t);
    let second = window_z[place_of_slot(t)];
    write_sum(group, t, SUM_CURVATURE_SECOND, dot(second, times_window(row, t)));
    if params.has_last_step == 1u {
        load_window(b, t, LAST_STEP);
        let product = times_window(row, t);
        let last = window_z[place_of_slot(t)];
        write_sum(group, t, SUM_LAST_FIRST, dot(vector(b, DIRECTION, t), product));
        workgroupBarrier();
        write_sum(group, t, SUM_LAST_SECOND, dot(second, product));
        workgroupBarrier();
        write_sum(group, t, SUM_LAST_CURVATURE, dot(last, product));
    }
}
