// Slopes of the surface at the warped nodes (method §2, Slopes), from which gradients of lengths are formed. They are
// computed from differences between the samples of a node's neighbours, so they depend continuously on the state.

/// Displacement, sample and triangle of a node.
struct NearNode {
    u: vec2f,
    value: vec3f,
    triangle: u32,
}

/// Node n of block b, from (-2, -2) to (17, 17): from the patch, or from the state one node beyond its halo.
fn near_node(b: u32, n: vec2i) -> NearNode {
    let w = n + 1;
    if all(w >= vec2i(0)) && all(w < vec2i(18)) { // model: 1 times, else beyond_patch times
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

/// The slopes at node n of block b, a movable node of its patch from (-1, -1) to (16, 16), with displacement u on
/// triangle t. They are the matrix S with S dW = dF, where dW and dF are the differences between the two neighbours on
/// each axis. On level 0 a small part of the tangents is mixed in; if all of these nodes lie on one triangle, the
/// slopes are its tangents, which suffer no cancellation.
fn slopes(b: u32, n: vec2i, u: vec2f, t: u32) -> mat2x3f {
    let west = near_node(b, n - vec2i(1, 0));
    let east = near_node(b, n + vec2i(1, 0));
    let south = near_node(b, n - vec2i(0, 1));
    let north = near_node(b, n + vec2i(0, 1));
    if TANGENTS && west.triangle == t && east.triangle == t && south.triangle == t && north.triangle == t {
        return tangents(t);
    }
    let wx = ((east.u - u) + vec2f(1.0, 0.0)) - ((west.u - u) - vec2f(1.0, 0.0));
    let wy = ((north.u - u) + vec2f(0.0, 1.0)) - ((south.u - u) - vec2f(0.0, 1.0));
    let fx = east.value - west.value;
    let fy = north.value - south.value;
    // The determinant is the sum of the four corner Jacobians at the node, which are positive.
    let inverse = 1.0 / (wx.x * wy.y - wx.y * wy.x);
    let differences = mat2x3f((fx * wy.y - fy * wx.y) * inverse, (fy * wx.x - fx * wy.x) * inverse);
    if TANGENTS {
        return differences + (tangents(t) - differences) * TANGENT_WEIGHT;
    }
    return differences;
}
