// A block with its halo in workgroup memory: 15552 bytes, which fits the 16 KiB of WebGPU's default limits.

var<workgroup> near_u: array<vec2f, 324>;
/// Position or metric at W, and rigidity.
var<workgroup> near_value: array<vec4f, 324>;
/// Rest lengths of the owned edges.
var<workgroup> near_length: array<vec4f, 324>;
/// Twice the triangle under W, plus 1 if the node is fixed.
var<workgroup> near_tag: array<u32, 324>;
/// Only if a setting asks for it.
var<workgroup> near_density: array<f32, 324>;

fn load_patch(b: u32, t: u32) {
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].neighbours[source.x];
        if holder == NONE {
            near_u[k] = vec2f();
            near_value[k] = vec4f();
            near_length[k] = vec4f();
            near_tag[k] = NONE;
        } else {
            let at = state_at(holder, 0u, source.y);
            let fixed_at = node_at(holder, 0u, source.y);
            let rigidity = nodes[fixed_at];
            near_u[k] = bitcast<vec2f>(vec2u(state[at], state[at + NODES]));
            near_value[k] = bitcast<vec4f>(
                vec4u(state[at + 2u * NODES], state[at + 3u * NODES], state[at + 4u * NODES], rigidity & 0x7fffffffu)
            );
            near_length[k] = bitcast<vec4f>(
                vec4u(nodes[fixed_at + NODES], nodes[fixed_at + 2u * NODES], nodes[fixed_at + 3u * NODES],
                    nodes[fixed_at + 4u * NODES])
            );
            near_tag[k] = (state[at + 5u * NODES] << 1u) | (rigidity >> 31u);
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

/// A node's place in the window, seen from node n of the block.
fn seen(n: vec2u, o: vec2i) -> u32 {
    let at = vec2u(vec2i(n) + 1 + o);
    return place(at.x, at.y);
}

fn fixed_in_patch(at: u32) -> bool {
    return (near_tag[at] & 1u) != 0u;
}

/// Where a node is: displacement and sample.
struct Here {
    u: vec2f,
    value: vec3f,
    slope: mat2x3f,
    /// Twice the triangle.
    tag: u32,
}

fn here(b: u32, n: vec2u) -> Here {
    let at = seen(n, vec2i());
    let tag = near_tag[at];
    let node = vec2i(vec2u(blocks[b].x, blocks[b].y) * 16u + n);
    return Here(near_u[at], near_value[at].xyz, slopes(b, node, near_u[at], triangle_of(tag)), tag & 0xfffffffeu);
}

fn triangle_of(tag: u32) -> u32 {
    return select(tag >> 1u, NONE, (tag | 1u) == NONE);
}
