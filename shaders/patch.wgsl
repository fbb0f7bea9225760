// A patch: a block with its halo in workgroup memory (method §1, Blocks). It takes 15552 bytes, which fits the 16 KiB
// of WebGPU's default limits. The kernel that includes this file declares PATCH_THREADS, the number of its threads.

var<workgroup> patch_u: array<vec2f, 324>;
/// Position or metric at W (3), and rigidity times 1 plus the multiplier (method §4, Harm).
var<workgroup> patch_value: array<vec4f, 324>;
/// Rest lengths of the owned edges.
var<workgroup> patch_length: array<vec4f, 324>;
/// Twice the index of the triangle under W, plus 1 if the node is fixed.
var<workgroup> patch_tag: array<u32, 324>;
/// Density of rigid material, or what holds a node; loaded only where a term needs it.
var<workgroup> patch_extra: array<u32, 324>;

/// The rest lengths of the owned edges of the node at slot s of block b, given the codings of the block's chart.
fn rest_lengths(b: u32, s: u32, base: array<u32, 4>, shift: array<u32, 4>) -> vec4f {
    let at = node_index(b, LENGTH, s);
    let low = nodes[at];
    let high = nodes[at + NODES];
    return vec4f(
        decode_length(low & 0xffffu, base[0], shift[0]), decode_length(low >> 16u, base[1], shift[1]),
        decode_length(high & 0xffffu, base[2], shift[2]), decode_length(high >> 16u, base[3], shift[3])
    );
}

fn load_patch(b: u32, t: u32) {
    let base = blocks[b].length_base;
    let shift = blocks[b].length_shift;
    for (var k = t; k < WINDOW; k += PATCH_THREADS) {
        let source = window_source(window_node(k));
        let holder = blocks[b].neighbours[source.x];
        if holder == NONE {
            patch_u[k] = vec2f();
            patch_value[k] = vec4f();
            patch_length[k] = vec4f();
            patch_tag[k] = NONE;
        } else {
            let rigidity = nodes[node_index(holder, RIGIDITY, source.y)];
            let fixed = (rigidity >> 31u) != 0u;
            let u = displacement(holder, source.y);
            let triangle = triangle_in_state(holder, source.y, fixed);
            let value = value_at(holder, source.y, u, triangle, fixed);
            patch_u[k] = u;
            let factor = 1.0 + f32(multiplier_code(rigidity)) * params.multiplier;
            patch_value[k] = vec4f(value, decode_rigidity(rigidity & 0xffffu) * factor);
            patch_length[k] = rest_lengths(holder, source.y, base, shift);
            patch_tag[k] = (triangle << 1u) | (rigidity >> 31u);
        }
        if params.orientation_density > 0.0 || params.hold > 0.0 {
            patch_extra[k] = 0u;
            if holder != NONE {
                patch_extra[k] = nodes[node_index(holder, EXTRA, source.y)];
            }
        }
    }
    workgroupBarrier();
}

/// Index in the window of the node at offset o from node n of the block.
fn place_at(n: vec2u, o: vec2i) -> u32 {
    return u32(i32(place(n.x + 1u, n.y + 1u)) + o.y * 18 + o.x);
}

fn fixed_in_patch(at: u32) -> bool {
    return (patch_tag[at] & 1u) != 0u;
}

/// The displacement of a node and the sample of the surface at W, with the tangents on level 0.
struct NodeState {
    u: vec2f,
    value: vec3f,
    tangents: mat2x3f,
    /// Twice the index of the triangle under W.
    tag: u32,
}

fn node_state(n: vec2u) -> NodeState {
    let at = place_at(n, vec2i());
    let tag = patch_tag[at];
    return NodeState(patch_u[at], patch_value[at].xyz, tangents(triangle_of(tag)), tag & 0xfffffffeu);
}

fn triangle_of(tag: u32) -> u32 {
    return select(tag >> 1u, NONE, (tag | 1u) == NONE);
}
