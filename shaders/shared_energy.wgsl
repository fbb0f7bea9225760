// The energy of a block (method §4). A term that depends on several movable nodes is divided equally among them (method
// §4, Sharing).

fn movable(n: vec2u, o: vec2i) -> f32 {
    return select(1.0, 0.0, fixed_in_patch(place_at(n, o)));
}

/// The energy of the block, from the sums and least Jacobians of 256 threads; only thread 0 receives it. A state with a
/// corner Jacobian below CRUSHED_JACOBIAN is invalid, however low its energy, unless folds are allowed. The sums, and
/// beside them the number of crushed nodes, take the memory of the patch.
fn energy_of_block(t: u32, sum: f32, worst: f32, allow_folds: bool) -> f32 {
    workgroupBarrier();
    patch_u[t] = vec2f(sum, select(1.0, 0.0, worst >= CRUSHED_JACOBIAN || allow_folds));
    workgroupBarrier();
    // 256 = 16 x 16.
    for (var stride = 16u; stride > 0u; stride -= 15u) {
        var sums = vec2f();
        if t < stride {
            for (var k = 0u; k < 16u; k++) {
                sums += patch_u[t + stride * k];
            }
        }
        workgroupBarrier();
        if t < stride {
            patch_u[t] = sums;
        }
        workgroupBarrier();
        if stride == 1u {
            break;
        }
    }
    let sums = patch_u[0];
    return select(INVALID_ENERGY, sums.x, sums.y == 0.0 && is_finite(sums.x));
}
