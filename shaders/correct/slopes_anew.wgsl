// For assemble.wgsl on devices with less than 24 KiB of workgroup memory: slopes are computed wherever they are needed.

fn load_slopes(b: u32, t: u32) {}

/// The slopes at node n of block b, a movable node of its patch.
fn slopes_of(b: u32, n: vec2i) -> mat2x3f {
    let k = place(u32(n.x + 1), u32(n.y + 1));
    return slopes(b, n, patch_u[k], triangle_of(patch_tag[k]));
}
