// energy: the energy of a level's present state, summed block by block (method §4). A term that depends on several
// movable nodes is divided equally among them (method §4, Sharing). Per node it reads what relax reads, and 44
// bytes per triangle; per block it writes 16.

var<workgroup> sums: array<f32, 64>;
var<workgroup> crushed: array<u32, 64>;

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
            sum += shared_energy(b, n, node_state(n), floor);
            for (var q = 0u; q < 4u; q++) {
                let m = cell_offsets(n, patch_u[place_at(n, vec2i())], q);
                for (var k = 0u; k < 3u; k++) {
                    worst = min(worst, cell_corner(m, k).jacobian);
                }
            }
        }
    }
    sums[t] = sum;
    // A state with a corner Jacobian under CRUSHED_JACOBIAN is invalid, however low its energy, unless folds are
    // allowed.
    crushed[t] = select(1u, 0u, worst >= CRUSHED_JACOBIAN || params.mode == ENERGY_ALLOWING_FOLDS);
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if t < half {
            sums[t] += sums[t + half];
            crushed[t] |= crushed[t + half];
        }
        workgroupBarrier();
    }
    if t == 0u {
        let valid = crushed[0] == 0u && is_finite(sums[0]);
        let energy = select(INVALID_ENERGY, sums[0], valid);
        partials[params.partial + group.y * SPREAD + group.x] = vec4f(energy, 0.0, 0.0, 0.0);
    }
}

fn movable(n: vec2u, o: vec2i) -> f32 {
    return select(1.0, 0.0, fixed_in_patch(place_at(n, o)));
}

fn shared_energy(b: u32, n: vec2u, p: NodeState, floor: f32) -> f32 {
    var sum = 0.0;
    for (var k = 0u; k < 8u; k++) {
        var energy = edge_energy(edge(n, p, k, floor));
        if params.pull > 0.0 {
            let change = change_of_offset(b, n, p.u, k);
            energy += pull_stiffness(k) * dot(change, change);
        }
        sum += (1.0 - 0.5 * movable(n, offset(k))) * energy;
    }
    for (var q = 0u; q < 4u; q++) {
        let s = quadrant(q);
        let m = cell_offsets(n, p.u, q);
        let a = movable(n, vec2i(s.x, 0));
        let b = movable(n, vec2i(0, s.y));
        let c = movable(n, s);
        sum += room(cell_corner(m, 0u).jacobian) / (a + b + 1.0);
        sum += room(cell_corner(m, 1u).jacobian) / (a + c + 1.0);
        sum += room(cell_corner(m, 2u).jacobian) / (b + c + 1.0);
    }
    return sum;
}
