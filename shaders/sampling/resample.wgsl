// Sets the displacements of blocks and, on level 0, finds the triangles there (method §2, Point location): to the
// identity or to the previous result. Per node `identity` writes 8 bytes; on level 0 it reads 8 of constants and writes
// 12, and reads 40 per triangle. In addition, `previous` reads 8 bytes of the result.

/// The previous result.
@group(0) @binding(10) var<storage, read> previous_result: array<f32>;

fn resample(b: u32, s: u32, u: vec2f) {
    set_displacement(b, s, u);
    find_triangle(b, s, u);
}

@compute @workgroup_size(256)
fn identity(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    resample(b, t, vec2f());
}

@compute @workgroup_size(256)
fn previous(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    let at = FINEST_STATE_PLANES * b * NODES + t;
    resample(b, t, vec2f(previous_result[at], previous_result[at + NODES]));
}
