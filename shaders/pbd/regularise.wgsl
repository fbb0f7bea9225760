// pbd: what follows the projections: regularisation (the paper's eq. 4-5), integration, and the prediction of the next
// iteration's positions. Per node it reads 32 bytes of state (a quarter of the displacements' more for the ring), 4 of
// constants and the triangle under it, and writes 32.

/// The 3x3 Gaussian K_G at node n.
fn gaussian(n: vec2u) -> vec2f {
    var lines: array<vec2f, 3>;
    for (var j = 0u; j < 3u; j++) {
        let y = i32(j) - 1;
        lines[j] = near_u[seen(n, vec2i(0, y))] * 0.5
            + (near_u[seen(n, vec2i(-1, y))] + near_u[seen(n, vec2i(1, y))]) * 0.25;
    }
    return lines[1] * 0.5 + (lines[0] + lines[2]) * 0.25;
}

@compute @workgroup_size(64)
fn regularise(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    load_u(b, t);
    workgroupBarrier();
    for (var colour = 0u; colour < 4u; colour++) {
        let s = own_slot(colour, t);
        let n = node_of(s);
        let here = near_u[seen(n, vec2i())];
        let tag = nodes[node_at(b, RIGIDITY, s)];
        let moves = (tag >> 31u) == 0u;
        // Eq. 4 where M is 1, and eq. 5; the Gaussian leaves the grid at rest as it is, so displacements can be smoothed
        // for positions.
        let rigidity = bitcast<f32>(tag & 0x7fffffffu);
        let blend = (1.0 - rigidity) + rigidity * params.smoothing;
        let integrated = here + blend * (gaussian(n) - here);
        var u = integrated;
        if (params.mode & PBD_WITHOUT_VELOCITY) == 0u {
            let at = vector_at(b, PREVIOUS, s);
            if (params.mode & PBD_LAST) == 0u {
                let before = bitcast<vec2f>(vec2u(other_state[at], other_state[at + NODES]));
                u = integrated + (integrated - before) * params.momentum;
            }
            other_state[at] = bitcast<u32>(integrated.x);
            other_state[at + NODES] = bitcast<u32>(integrated.y);
        }
        move_to(b, s, u, moves);
    }
}
