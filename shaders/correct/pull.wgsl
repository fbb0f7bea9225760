// correct: adds the pull towards the previous result to the right-hand side of an assembled system. It is a separate
// kernel, because `assemble` already uses the maximum number of buffers.

@compute @workgroup_size(64)
fn pull(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_patch(b, t);
    for (var colour = 0u; colour < 4u; colour++) {
        let s = thread_slot(colour, t);
        let n = node_at(s);
        let at = place_at(n, vec2i());
        if !fixed_in_patch(at) {
            let gradient = pull_gradient(b, n, patch_u[at]);
            vectors[vector_index(b, RESIDUAL, s)] -= gradient.x;
            vectors[vector_index(b, RESIDUAL + 1u, s)] -= gradient.y;
        }
    }
}
