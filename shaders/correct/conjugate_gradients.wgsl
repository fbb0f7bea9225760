// correct: products with the matrix for conjugate gradients (method §7.3). Their scalars are formed chart by chart, from sums
// per block, and stand in `charts` (control.wgsl). `product` reads 44 bytes of rows, 8 of vectors (a quarter more for the
// halo) and 1 of weights per node, and writes 16 and 3 of contributions; `curvature` reads 44 and 8.

/// z0 . A z0, and A z0 itself, with which the second V-cycle begins while the rows are there: it is linear, so that what it
/// makes of the next residual follows from what it makes of A z0, before the length of the first step is known.
@compute @workgroup_size(64)
fn product(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_window(b, t, DIRECTION);
    write_sum(group, t, SUM_Z_PRODUCT, store_product(b, t));
    storageBarrier();
    smooth_from_zero(b, t, PRODUCT);
    load_weights(b, t);
    contribute(b, t, PRODUCT);
}

/// Stores A z where the window holds z; returns this thread's part of z . A z.
fn store_product(b: u32, t: u32) -> f32 {
    var sum = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        let z = window_z[place_of_slot(s)];
        let v = off_diagonal(b, vec2i(node_at(s)), false) + diagonal_times(b, s, z);
        set_vector(b, PRODUCT, s, v);
        sum += dot(z, v);
    }
    return sum;
}

/// z1 . A z1, where z1 is in the place of r.
@compute @workgroup_size(64)
fn curvature(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_window(b, t, RESIDUAL);
    var sum = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        let z = window_z[place_of_slot(s)];
        sum += dot(z, off_diagonal(b, vec2i(node_at(s)), false) + diagonal_times(b, s, z));
    }
    write_sum(group, t, SUM_CURVATURE_SECOND, sum);
}
