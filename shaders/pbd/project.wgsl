// pbd: the projection of one of the eight sets of edges (method §10; the paper's section 4.2, figure 8). Each edge is
// scaled towards its rest length in proportion to its rigidity, and turned back towards its rest direction; no end
// leaves the bounding box of its neighbours. Each end of an edge computes the projection independently. On level 0 it
// reads 12 bytes of state and 8 of constants per node (a quarter more for the halo; 4 more constants if
// `orientation_density` is not 0) and 72 per triangle, and writes 12 per node. On coarser levels it reads 8 bytes of
// state, 8 of constants and 12 of metrics per node, and writes 8.

var<workgroup> patch_value: array<vec3f, 324>;
/// Rigidity; sign bit: fixed.
var<workgroup> patch_rigidity: array<u32, 324>;
/// Rest length of the set's edge that a node owns.
var<workgroup> patch_length: array<f32, 324>;
/// Density of rigid material; loaded only if `orientation_density` is not 0.
var<workgroup> patch_density: array<f32, 324>;

/// Must follow `load_u`, which sets the displacements of the same thread.
fn load_values(b: u32, t: u32) {
    let edge = (params.mode & 7u) >> 1u;
    let base = blocks[b].length_base[edge];
    let shift = blocks[b].length_shift[edge];
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].neighbours[source.x];
        patch_value[k] = vec3f();
        patch_rigidity[k] = 0x80000000u;
        patch_length[k] = 0.0;
        if holder != NONE {
            let rigidity = nodes[node_index(holder, RIGIDITY, source.y)];
            let fixed = (rigidity >> 31u) != 0u;
            let triangle = present_triangle(holder, source.y, fixed);
            patch_value[k] = value_at(holder, source.y, patch_u[k], triangle, fixed);
            patch_rigidity[k] = bitcast<u32>(decode_rigidity(rigidity & 0xffffu)) | (rigidity & 0x80000000u);
            patch_length[k] = decode_length(length_code(holder, edge, source.y), base, shift);
        }
        if params.orientation_density > 0.0 {
            patch_density[k] = 0.0;
            if holder != NONE {
                patch_density[k] = bitcast<f32>(nodes[node_index(holder, EXTRA, source.y)]);
            }
        }
    }
    workgroupBarrier();
}

fn rigidity_at(at: u32) -> f32 {
    return bitcast<f32>(patch_rigidity[at] & 0x7fffffffu);
}

fn is_fixed_at(at: u32) -> bool {
    return (patch_rigidity[at] >> 31u) != 0u;
}

/// An edge's offset after projection and rotation: d scaled by 1 + stiffness (ratio - 1), with `ratio` the rest length
/// over the length, its direction then blended with that of d0 by `fraction`.
fn projected(d: vec2f, d0: vec2f, ratio: f32, stiffness: f32, fraction: f32) -> vec2f {
    let along = d * ((ratio - 1.0) * stiffness + 1.0);
    let length = sqrt(dot(along, along) + TINY);
    let turned = (along / length) * (1.0 - fraction) + fraction * (d0 / sqrt(dot(d0, d0)));
    return turned * (length / sqrt(dot(turned, turned) + TINY));
}

/// The new displacement of a node, and whether its edge of this set is projected at all.
struct Projection {
    u: vec2f,
    is_projected: bool,
}

fn project_node(n: vec2u, floor: f32) -> Projection {
    let at_node = place_at(n, vec2i());
    let u_node = patch_u[at_node];
    // The far end of the only edge of this set at the node. The parity of i distinguishes the two sets of horizontal
    // edges, the parity of j the sets of the other directions.
    let edge = (params.mode & 7u) >> 1u;
    let along = select(n.y, n.x, edge == 0u);
    let node_owns = (along & 1u) == (params.mode & 1u);
    let o = offset(select(edge + 4u, edge, node_owns));
    let at_neighbour = place_at(n, o);
    let weight = max(rigidity_at(at_node), rigidity_at(at_neighbour));
    if is_fixed_at(at_node) || weight == 0.0 {
        return Projection(u_node, false);
    }
    let d0 = vec2f(o);
    let d = (patch_u[at_neighbour] - u_node) + d0;
    let current = chord(patch_value[at_node], mat2x3f(), patch_value[at_neighbour], false, d).length;
    let rest = max(patch_length[select(at_neighbour, at_node, node_owns)], floor);
    var fraction = params.orientation_fraction;
    if params.orientation_density > 0.0 {
        let density = patch_density[at_node] + patch_density[at_neighbour];
        fraction = min(fraction + 0.5 * params.orientation_density * density, 1.0);
    }
    let new_offset = projected(d, d0, rest / current, weight * params.correction, fraction * params.correction);
    // Each end takes half of the change of the offset; if one end is fixed, the other takes all of it.
    var u = u_node + (d - new_offset) * select(0.5, 1.0, is_fixed_at(at_neighbour));
    var low = vec2f(INVALID_ENERGY);
    var high = vec2f(-INVALID_ENERGY);
    for (var k = 0u; k < 8u; k++) {
        let at = patch_u[place_at(n, offset(k))] + vec2f(offset(k));
        low = min(low, at);
        high = max(high, at);
    }
    u = clamp(u, low, high);
    return Projection(u, true);
}

@compute @workgroup_size(64)
fn project(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_u(b, t);
    load_values(b, t);
    let floor = charts[blocks[b].chart].length_floor * params.scale;
    for (var colour = 0u; colour < 4u; colour++) {
        let s = thread_slot(colour, t);
        let projection = project_node(node_at(s), floor);
        move_to(b, s, projection.u, projection.is_projected);
    }
}
