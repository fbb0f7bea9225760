// For slopes.wgsl, at the nodes of a patch: their neighbours are in the patch or one node beyond it.

/// Node n of block b, from (-2, -2) to (17, 17): from the patch, or from the state one node beyond its halo.
fn near_node(b: u32, n: vec2i) -> NearNode {
    let w = n + 1;
    if all(w >= vec2i(0)) && all(w < vec2i(18)) {
        let at = place(u32(w.x), u32(w.y));
        return NearNode(patch_u[at], patch_value[at].xyz, triangle_of(patch_tag[at]));
    }
    let m = vec2u(n + 16);
    let holder = blocks[b].neighbours[m.y / 16u * 3u + m.x / 16u];
    if holder == NONE {
        return NearNode(vec2f(), vec3f(), NONE);
    }
    let s = slot(m.x % 16u, m.y % 16u);
    let fixed = is_fixed(holder, s);
    let u = displacement(holder, s);
    let triangle = triangle_in_state(holder, s, fixed);
    return NearNode(u, value_at(holder, s, u, triangle, fixed), triangle);
}
