// energy: the energy of a level's present state, summed block by block (method §4). Per node it reads what relax reads,
// and 44 bytes per triangle; per block it writes 4.

const PATCH_THREADS: u32 = 256u;

/// A node's share of its terms, and its least corner Jacobian.
struct Share {
    energy: f32,
    worst: f32,
}

/// The node's share of the values of its edges and corners, and its hold.
fn share(n: vec2u, p: NodeState, floor: f32) -> Share {
    var sum = Share(hold(n, p.u), 1.0);
    for (var k = 0u; k < 8u; k++) {
        sum.energy += (1.0 - 0.5 * movable(n, offset(k))) * edge_energy(edge(n, p, k, floor));
    }
    for (var q = 0u; q < 4u; q++) {
        let s = quadrant(q);
        let m = cell_offsets(n, p.u, q);
        let a = movable(n, vec2i(s.x, 0));
        let b = movable(n, vec2i(0, s.y));
        let c = movable(n, s);
        let sharers = vec3f(a + b, a + c, b + c) + 1.0;
        for (var k = 0u; k < 3u; k++) {
            let jacobian = cell_corner(m, k).jacobian;
            sum.energy += room(jacobian) / sharers[k];
            sum.worst = min(sum.worst, jacobian);
        }
    }
    return sum;
}

@compute @workgroup_size(256)
fn energy(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) s: u32) {
    let b = block_of_workgroup(group, s);
    if b == NONE {
        return;
    }
    load_patch(b, s);
    let floor = charts[blocks[b].chart].length_floor * params.scale;
    let n = node_at(s);
    var sum = Share(0.0, 1.0);
    if !fixed_in_patch(place_at(n, vec2i())) {
        let p = node_state(n);
        sum = share(n, p, floor);
        if params.pull > 0.0 {
            sum.energy += shared_pull(b, n, p.u);
        }
    }
    let energy = energy_of_block(s, sum.energy, sum.worst, params.mode == ENERGY_ALLOWING_FOLDS);
    if s == 0u {
        partials[sum_index(SUM_ENERGY, group.y * SPREAD + group.x)] = energy;
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
