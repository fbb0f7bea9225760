// Slopes of the surface at the warped nodes (method §2, Slopes), from which gradients of lengths are formed. They are
// computed from differences between the samples of a node's neighbours, so they depend continuously on the state. A
// file before this one says where these are found: in the patch (near_in_patch.wgsl), or also one node beyond its halo
// (near_beyond.wgsl).

/// Displacement, sample and triangle of a node.
struct NearNode {
    u: vec2f,
    value: vec3f,
    triangle: u32,
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
