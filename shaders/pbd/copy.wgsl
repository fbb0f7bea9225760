// pbd: copies a block's state from one place to the other one as it is, 48 bytes per node; with velocities of 0.

@compute @workgroup_size(64)
fn copy_state(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    for (var colour = 0u; colour < 4u; colour++) {
        let s = own_slot(colour, t);
        for (var plane = 0u; plane < STATE_PLANES; plane++) {
            let bits = get_state(b, plane, s);
            put_state(b, plane, s, bits);
            if plane < 2u && (params.mode & PBD_WITHOUT_VELOCITY) == 0u {
                other_state[vector_at(b, PREVIOUS + plane, s)] = bits;
            }
        }
    }
}
