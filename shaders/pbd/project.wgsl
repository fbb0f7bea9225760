// pbd: the projection of one of the eight sets of constraints (the paper's section 4.2, figure 8): each segment takes its
// rest length as far as it is rigid, is turned back toward its rest direction, and no end leaves the bounding box of its
// neighbours. Both ends of a segment work it out, each for itself. Per node it reads 24 bytes of state and 8 of constants
// (a quarter more for the ring) and the triangle under it, and writes 24.

var<workgroup> near_value: array<vec3f, 324>;
/// Rigidity; sign bit: fixed.
var<workgroup> near_rigidity: array<u32, 324>;
/// Rest length of the set's edge that a node owns.
var<workgroup> near_length: array<f32, 324>;
/// Only if a setting asks for it.
var<workgroup> near_density: array<f32, 324>;

fn load_ends(b: u32, t: u32) {
    let edge = (params.mode & 7u) >> 1u;
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].neighbours[source.x];
        near_value[k] = vec3f();
        near_rigidity[k] = 0x80000000u;
        near_length[k] = 0.0;
        if holder != NONE {
            near_value[k] = bitcast<vec3f>(vec3u(
                get_state(holder, VALUE, source.y),
                get_state(holder, VALUE + 1u, source.y),
                get_state(holder, VALUE + 2u, source.y)
            ));
            near_rigidity[k] = nodes[node_at(holder, RIGIDITY, source.y)];
            near_length[k] = bitcast<f32>(nodes[node_at(holder, LENGTH + edge, source.y)]);
        }
        if params.orientation_density > 0.0 {
            near_density[k] = 0.0;
            if holder != NONE {
                near_density[k] = bitcast<f32>(nodes[node_at(holder, DENSITY, source.y)]);
            }
        }
    }
    workgroupBarrier();
}

fn rigidity_of(at: u32) -> f32 {
    return bitcast<f32>(near_rigidity[at] & 0x7fffffffu);
}

fn is_still(at: u32) -> bool {
    return (near_rigidity[at] >> 31u) != 0u;
}

/// A segment's offset after projection and rotation: d scaled by 1 + stiffness (l / L - 1), its direction then blended with
/// that at rest.
fn projected(d: vec2f, d0: vec2f, ratio: f32, stiffness: f32, share: f32) -> vec2f {
    let along = d * ((ratio - 1.0) * stiffness + 1.0);
    let length = sqrt(dot(along, along) + TINY);
    let turned = (along / length) * (1.0 - share) + share * (d0 / sqrt(dot(d0, d0)));
    return turned * (length / sqrt(dot(turned, turned) + TINY));
}

/// Where node n of the block goes; the flag tells whether its segment is projected at all.
struct Moved {
    u: vec2f,
    moves: bool,
}

fn project_node(n: vec2u, floor: f32) -> Moved {
    let own = seen(n, vec2i());
    let here = near_u[own];
    // The other end of the one edge of this set that the node has: horizontal edges are told apart by i, others by j.
    let edge = (params.mode & 7u) >> 1u;
    let along = select(n.y, n.x, edge == 0u);
    let owned = (along & 1u) == (params.mode & 1u);
    let o = offset(select(edge + 4u, edge, owned));
    let other = seen(n, o);
    let weight = max(rigidity_of(own), rigidity_of(other));
    if is_still(own) || weight == 0.0 {
        return Moved(here, false);
    }
    let d0 = vec2f(o);
    let d = (near_u[other] - here) + d0;
    let current = chord(near_value[own], mat2x3f(), near_value[other], false, d).length;
    let rest = max(near_length[select(other, own, owned)], floor);
    var share = params.orientation_fraction;
    if params.orientation_density > 0.0 {
        share = min(share + 0.5 * params.orientation_density * (near_density[own] + near_density[other]), 1.0);
    }
    let target_ = projected(d, d0, rest / current, weight * params.correction, share * params.correction);
    // An end that is fixed leaves the whole way to the other one.
    var u = here + (d - target_) * select(0.5, 1.0, is_still(other));
    var low = vec2f(INVALID_ENERGY);
    var high = vec2f(-INVALID_ENERGY);
    for (var k = 0u; k < 8u; k++) {
        let at = near_u[seen(n, offset(k))] + vec2f(offset(k));
        low = min(low, at);
        high = max(high, at);
    }
    u = clamp(u, low, high);
    return Moved(u, true);
}

@compute @workgroup_size(64)
fn project(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    load_u(b, t);
    load_ends(b, t);
    let floor = charts[blocks[b].chart].length_floor * params.scale;
    for (var colour = 0u; colour < 4u; colour++) {
        let s = own_slot(colour, t);
        let moved = project_node(node_of(s), floor);
        move_to(b, s, moved.u, moved.moves);
    }
}
