// pbd: copies the state of blocks from one of the two copies to the other (method §10), and sets velocities to 0 unless
// PBD_WITHOUT_VELOCITY is set. Per node it reads 8 bytes and writes 8, with velocities 16; 4 more each on level 0.

@compute @workgroup_size(64)
fn copy_state(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    for (var colour = 0u; colour < 4u; colour++) {
        let s = thread_slot(colour, t);
        for (var plane = 0u; plane < params.state_planes; plane++) {
            let bits = get_state(b, plane, s);
            put_state(b, plane, s, bits);
            if plane < 2u && (params.mode & PBD_WITHOUT_VELOCITY) == 0u {
                other_state[vector_index(b, U_INTEGRATED + plane, s)] = bits;
            }
        }
    }
}
