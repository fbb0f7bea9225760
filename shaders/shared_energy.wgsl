// The energy of a block's nodes (method §4). A term that depends on several movable nodes is divided equally among them
// (method §4, Sharing).

var<workgroup> energies: array<f32, 64>;
var<workgroup> crushed: array<u32, 64>;

fn movable(n: vec2u, o: vec2i) -> f32 {
    return select(1.0, 0.0, fixed_in_patch(place_at(n, o)));
}

/// The node's share of the values of its edges and corners, and its hold.
fn shared_energy(n: vec2u, p: NodeState, floor: f32) -> f32 {
    var sum = hold(n, p.u);
    for (var k = 0u; k < 8u; k++) {
        sum += (1.0 - 0.5 * movable(n, offset(k))) * edge_energy(edge(n, p, k, floor));
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

/// The minimum of `worst` and the corner Jacobians that depend on node n.
fn worst_corner(n: vec2u, worst: f32) -> f32 {
    var least = worst;
    for (var q = 0u; q < 4u; q++) {
        let m = cell_offsets(n, patch_u[place_at(n, vec2i())], q);
        for (var k = 0u; k < 3u; k++) {
            least = min(least, cell_corner(m, k).jacobian);
        }
    }
    return least;
}

/// The energy of the block, from all threads' sums and least Jacobians; only thread 0 receives it. A state with a
/// corner Jacobian below CRUSHED_JACOBIAN is invalid, however low its energy, unless folds are allowed.
fn energy_of_block(t: u32, sum: f32, worst: f32, allow_folds: bool) -> f32 {
    energies[t] = sum;
    crushed[t] = select(1u, 0u, worst >= CRUSHED_JACOBIAN || allow_folds);
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if t < half {
            energies[t] += energies[t + half];
            crushed[t] |= crushed[t + half];
        }
        workgroupBarrier();
    }
    return select(INVALID_ENERGY, energies[0], crushed[0] == 0u && is_finite(energies[0]));
}
