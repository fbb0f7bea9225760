// pbd: regularisation (the paper's eq. 4 and 5), integration, and the prediction of the displacements from which the
// next projections begin (method §10). Per node it reads 16 bytes of state (displacements a quarter more for the halo)
// and 4 of constants, and writes 16; on level 0 it reads and writes 4 more, and reads 36 per triangle.

/// Displacements under the 3x3 Gaussian K at node n.
fn gaussian(n: vec2u) -> vec2f {
    var lines: array<vec2f, 3>;
    for (var j = 0u; j < 3u; j++) {
        let y = i32(j) - 1;
        lines[j] = patch_u[place_at(n, vec2i(0, y))] * 0.5
            + (patch_u[place_at(n, vec2i(-1, y))] + patch_u[place_at(n, vec2i(1, y))]) * 0.25;
    }
    return lines[1] * 0.5 + (lines[0] + lines[2]) * 0.25;
}

@compute @workgroup_size(64)
fn regularise(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_u(b, t);
    workgroupBarrier();
    for (var colour = 0u; colour < 4u; colour++) {
        let s = thread_slot(colour, t);
        let n = node_at(s);
        let u_before = patch_u[place_at(n, vec2i())];
        let word = nodes[node_index(b, RIGIDITY, s)];
        let moves = (word >> 31u) == 0u;
        // Eq. 4 for movable nodes, and eq. 5. The Gaussian reproduces the grid at rest, so smoothing displacements is
        // equivalent to smoothing positions.
        let rigidity = decode_rigidity(word & 0xffffu);
        let blend = (1.0 - rigidity) + rigidity * params.smoothing;
        let integrated = u_before + blend * (gaussian(n) - u_before);
        var u = integrated;
        if (params.mode & PBD_WITHOUT_VELOCITY) == 0u {
            let at = vector_index(b, U_INTEGRATED, s);
            if (params.mode & PBD_LAST) == 0u {
                let last_integrated = bitcast<vec2f>(vec2u(other_state[at], other_state[at + NODES]));
                u = integrated + (integrated - last_integrated) * params.momentum;
            }
            other_state[at] = bitcast<u32>(integrated.x);
            other_state[at + NODES] = bitcast<u32>(integrated.y);
        }
        if params.hold > 0.0 {
            // At an open border along which texture slides, nothing moves across it.
            let across = unpack2x16snorm(nodes[node_index(b, EXTRA, s)]);
            u -= across * (dot(across, u) / max(dot(across, across), TINY));
        }
        move_to(b, s, u, moves);
    }
}
