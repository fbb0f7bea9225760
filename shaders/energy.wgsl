// The energy of a level's present state, block by block. An edge or a corner between several movable nodes is shared
// among them. Reads what relax reads; writes 16 bytes per block.

var<workgroup> sums: array<f32, 64>;
var<workgroup> crushed: array<u32, 64>;

@compute @workgroup_size(64)
fn energy(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    load_patch(b, t);
    let floor = charts[blocks[b].chart].length_floor * params.scale;
    var sum = 0.0;
    var worst = 1.0;
    for (var colour = 0u; colour < 4u; colour++) {
        let n = node_of(own_slot(colour, t));
        if !fixed_in_patch(seen(n, vec2i())) {
            sum += shared_energy(n, here(b, n), floor);
            for (var q = 0u; q < 4u; q++) {
                let m = arms(n, near_u[seen(n, vec2i())], q);
                for (var k = 0u; k < 3u; k++) {
                    worst = min(worst, corner_of(m, k).jacobian);
                }
            }
        }
    }
    sums[t] = sum;
    // A state with crushed cells is worth nothing, however low its energy; unless it is taken as it is.
    crushed[t] = select(1u, 0u, worst >= CRUSHED_JACOBIAN || params.mode == ENERGY_AS_IS);
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if t < half {
            sums[t] += sums[t + half];
            crushed[t] |= crushed[t + half];
        }
        workgroupBarrier();
    }
    if t == 0u {
        let good = crushed[0] == 0u && is_number(sums[0]);
        partials[params.partial + group.y * SPREAD + group.x] = vec4f(select(INVALID_ENERGY, sums[0], good), 0.0, 0.0, 0.0);
    }
}

fn movable(n: vec2u, o: vec2i) -> f32 {
    return select(1.0, 0.0, fixed_in_patch(seen(n, o)));
}

fn shared_energy(n: vec2u, p: Here, floor: f32) -> f32 {
    var sum = 0.0;
    for (var k = 0u; k < 8u; k++) {
        sum += (1.0 - 0.5 * movable(n, offset(k))) * edge_energy(edge(n, p, k, floor));
    }
    for (var q = 0u; q < 4u; q++) {
        let s = quadrant(q);
        let m = arms(n, p.u, q);
        let a = movable(n, vec2i(s.x, 0));
        let b = movable(n, vec2i(0, s.y));
        let c = movable(n, s);
        sum += room(corner_of(m, 0u).jacobian) / (a + b + 1.0);
        sum += room(corner_of(m, 1u).jacobian) / (a + c + 1.0);
        sum += room(corner_of(m, 2u).jacobian) / (b + c + 1.0);
    }
    return sum;
}
