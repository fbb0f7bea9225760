// For assemble.wgsl: the slopes of a patch in workgroup memory. Each is computed once for the nine nodes that need it.
// They take 7776 bytes, more than WebGPU's default limits leave beside a patch.

/// Per coordinate of the surface (or component of the metric), its slopes along x and y.
var<workgroup> kept_x: array<vec2f, 324>;
var<workgroup> kept_y: array<vec2f, 324>;
var<workgroup> kept_z: array<vec2f, 324>;

fn load_slopes(b: u32, t: u32) {
    for (var k = t; k < WINDOW; k += PATCH_THREADS) {
        if !fixed_in_patch(k) {
            let s = slopes(b, vec2i(window_node(k)) - 1, patch_u[k], triangle_of(patch_tag[k]));
            kept_x[k] = vec2f(s[0].x, s[1].x);
            kept_y[k] = vec2f(s[0].y, s[1].y);
            kept_z[k] = vec2f(s[0].z, s[1].z);
        }
    }
    workgroupBarrier();
}

/// The slopes at node n of block b, a movable node of its patch.
fn slopes_of(b: u32, n: vec2i) -> mat2x3f {
    let k = place(u32(n.x + 1), u32(n.y + 1));
    return mat2x3f(vec3f(kept_x[k].x, kept_y[k].x, kept_z[k].x), vec3f(kept_x[k].y, kept_y[k].y, kept_z[k].y));
}
