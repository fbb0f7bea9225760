// correct: adds the pull towards the previous result to the right-hand side of an assembled system. It is a separate
// kernel, because `assemble` already uses the maximum number of buffers.

const PATCH_THREADS: u32 = 256u;

@compute @workgroup_size(256)
fn pull(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) s: u32) {
    let b = block_of_workgroup(group, s);
    if b == NONE {
        return;
    }
    load_patch(b, s);
    let n = node_at(s);
    let at = place_at(n, vec2i());
    if !fixed_in_patch(at) {
        let gradient = pull_gradient(b, n, patch_u[at]);
        vectors[vector_index(b, RESIDUAL, s)] -= gradient.x;
        vectors[vector_index(b, RESIDUAL + 1u, s)] -= gradient.y;
    }
}
