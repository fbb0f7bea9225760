// energy: the energy of a level's present state, summed block by block (method §4). Per node it reads what relax reads, and
// 44 bytes per triangle; per block it writes 4.

@compute @workgroup_size(64)
fn energy(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_patch(b, t);
    let floor = charts[blocks[b].chart].length_floor * params.scale;
    var sum = 0.0;
    var worst = 1.0;
    for (var colour = 0u; colour < 4u; colour++) {
        let n = node_at(thread_slot(colour, t));
        if !fixed_in_patch(place_at(n, vec2i())) {
            let p = node_state(n);
            sum += shared_energy(n, p, floor);
            if params.pull > 0.0 {
                sum += shared_pull(b, n, p.u);
            }
            worst = worst_corner(n, worst);
        }
    }
    let energy = energy_of_block(t, sum, worst, params.mode == ENERGY_ALLOWING_FOLDS);
    if t == 0u {
        partials[sum_index(SUM_ENERGY, params.partial + group.y * SPREAD + group.x)] = energy;
    }
}

/// The node's share of the pull's terms in its edges.
fn shared_pull(b: u32, n: vec2u, u: vec2f) -> f32 {
    var sum = 0.0;
    for (var k = 0u; k < 8u; k++) {
        let change = change_of_offset(b, n, u, k);
        sum += (1.0 - 0.5 * movable(n, offset(k))) * pull_stiffness(k) * dot(change, change);
    }
    return sum;
}
