// What all kernels share: the buffers, and how a thread finds its node. The structs in the buffers and the constants stand
// in generated.wgsl.
//
// A workgroup of 64 threads works on one block of 16x16 nodes; thread t is the node of row t / 8 and column t % 8 of
// each of the four colours in turn. A plane is one quantity at a block's nodes, colour after colour.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> charts: array<Chart>;
@group(0) @binding(2) var<storage, read> blocks: array<BlockRecord>;
@group(0) @binding(3) var<storage, read> lists: array<u32>;
/// Per block: rigidity (sign bit: fixed), four rest lengths, triangle under the node or coverage, density of rigid material.
@group(0) @binding(4) var<storage, read> nodes: array<u32>;
/// Per block: displacement (2), position or metric at W (3), triangle under W.
@group(0) @binding(5) var<storage, read_write> state: array<u32>;
/// Per block: diagonal (3), pairs of the owned edges (two words each, see `encode`), and, uploaded once, what a correction's
/// interpolation from the next coarser level gives to the lower neighbour (of odd columns: to the west; of even columns in
/// odd rows: to the south).
@group(0) @binding(7) var<storage, read_write> rows: array<u32>;
/// Per block: r, z, t, x (2 each). r is the right-hand side, then the residual; z the preconditioner's result, then the
/// direction; t A z, and the residual inside the V-cycle; x the step. Once the system is solved, r is the share of the step
/// that a node takes (the two planes in turn), and t first a mark, then the state before the step.
@group(0) @binding(8) var<storage, read_write> vectors: array<f32>;
/// Per block of a list: what it gives to its chart.
@group(0) @binding(9) var<storage, read_write> partials: array<vec4f>;

/// Place of a node in `nodes`, `state`, `rows`, `vectors`.
fn node_at(b: u32, plane: u32, s: u32) -> u32 {
    return (b * NODE_PLANES + plane) * NODES + s;
}
fn state_at(b: u32, plane: u32, s: u32) -> u32 {
    return (b * STATE_PLANES + plane) * NODES + s;
}
fn row_at(b: u32, plane: u32, s: u32) -> u32 {
    return ((params.base + b) * ROW_PLANES + plane) * NODES + s;
}
fn vector_at(b: u32, plane: u32, s: u32) -> u32 {
    return ((params.base + b) * VECTOR_PLANES + plane) * NODES + s;
}

/// A 2x2 block (row-major) as four bfloat16, that is f32 without the last 16 bits, rounded: xx and the mean of xy and yx;
/// yy and half their difference. What rounding takes from a pair, the diagonals of both of its nodes give back, so that the
/// sum of a row stays exact (src/cpu/correct/rows.rs).
fn encode(a: vec4f) -> vec2u {
    let bits = bitcast<vec4u>(vec4f(a.x, 0.5 * (a.y + a.z), a.w, 0.5 * (a.y - a.z)));
    let rounded = bits + 0x7fffu + ((bits >> vec4u(16u)) & vec4u(1u));
    return (rounded.xz & vec2u(0xffff0000u)) | (rounded.yw >> vec2u(16u));
}

fn decode(words: vec2u) -> vec4f {
    let high = bitcast<vec2f>(words & vec2u(0xffff0000u));
    let low = bitcast<vec2f>(words << vec2u(16u));
    return vec4f(high.x, low.x + low.y, low.x - low.y, high.y);
}

/// (xx, xy, yy) of the symmetric part of what `encode` takes from a 2x2 block.
fn lost(a: vec4f) -> vec3f {
    let rest = a - decode(encode(a));
    return vec3f(rest.x, 0.5 * (rest.y + rest.z), rest.w);
}

/// Slot of node (i, j) of a block in a plane.
fn slot(i: u32, j: u32) -> u32 {
    return ((j & 1u) * 2u + (i & 1u)) * 64u + (j >> 1u) * 8u + (i >> 1u);
}

/// The node (i, j) of a slot.
fn node_of(s: u32) -> vec2u {
    let colour = s / 64u;
    return vec2u(2u * (s % 8u) + (colour & 1u), 2u * (s / 8u % 8u) + (colour >> 1u));
}

/// Place of the node (i - 1, j - 1) of a block in its window of 18x18: four colour planes of 9x9.
fn place(i: u32, j: u32) -> u32 {
    return ((j & 1u) * 2u + (i & 1u)) * 81u + (j >> 1u) * 9u + (i >> 1u);
}

/// The window's node (i, j) at a place.
fn window_node(k: u32) -> vec2u {
    let colour = k / 81u;
    let rest = k % 81u;
    return vec2u(2u * (rest % 9u) + (colour & 1u), 2u * (rest / 9u) + (colour >> 1u));
}

/// Which of the 3x3 blocks around holds the window's node n, and at which slot.
fn window_source(n: vec2u) -> vec2u {
    let by = (n + 15u) / 16u;
    let at = (n + 15u) % 16u;
    return vec2u(by.y * 3u + by.x, slot(at.x, at.y));
}

/// Neighbour k of 8: offset; k & 3 is the edge, owned by the neighbour if k > 3.
fn offset(k: u32) -> vec2i {
    let e = k & 3u;
    var d = vec2i(1, 1);
    if e == 0u {
        d = vec2i(1, 0);
    } else if e == 1u {
        d = vec2i(0, 1);
    } else if e == 3u {
        d = vec2i(-1, 1);
    }
    return select(d, -d, k > 3u);
}

/// Quadrant q of 4: the signs of its direction.
fn quadrant(q: u32) -> vec2i {
    return vec2i(select(1, -1, (q & 1u) != 0u), select(1, -1, (q & 2u) != 0u));
}

fn is_number(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

fn is_fixed(b: u32, s: u32) -> bool {
    return (nodes[node_at(b, RIGIDITY, s)] >> 31u) != 0u;
}

fn displacement(b: u32, s: u32) -> vec2f {
    return vec2f(bitcast<f32>(state[state_at(b, U, s)]), bitcast<f32>(state[state_at(b, U + 1u, s)]));
}

/// Slot of the node of colour k that thread t works on.
fn own_slot(k: u32, t: u32) -> u32 {
    return k * 64u + t;
}

/// A block's node in its level.
fn node_in_level(b: u32, s: u32) -> vec2i {
    return vec2i(vec2u(blocks[b].x, blocks[b].y) * 16u + node_of(s));
}

/// The block that holds node (i, j) of the chart of block b, or NONE.
fn holding(b: u32, i: i32, j: i32) -> u32 {
    let at = vec2i(i >> 4u, j >> 4u);
    let d = at - vec2i(i32(blocks[b].x), i32(blocks[b].y));
    if all(abs(d) <= vec2i(1)) {
        return blocks[b].neighbours[(d.y + 1) * 3 + d.x + 1];
    }
    let found = find(b, at);
    if found == NONE && blocks[b].continues != 0u {
        // Beyond what this band holds of the chart: the nearest row stands in, which only coarse metrics notice.
        let first = blocks[b].chart_first;
        let lowest = i32(blocks[first].y);
        let highest = i32(blocks[first + blocks[b].chart_count - 1u].y);
        if at.y < lowest && (blocks[b].continues & 1u) != 0u {
            return find(b, vec2i(at.x, lowest));
        }
        if at.y > highest && (blocks[b].continues & 2u) != 0u {
            return find(b, vec2i(at.x, highest));
        }
    }
    return found;
}

/// The block of the chart of block b at (x, y), or NONE.
fn find(b: u32, at: vec2i) -> u32 {
    var low = blocks[b].chart_first;
    var high = low + blocks[b].chart_count;
    while low < high {
        let middle = (low + high) / 2u;
        let found = vec2i(i32(blocks[middle].x), i32(blocks[middle].y));
        if all(found == at) {
            return middle;
        }
        if found.y < at.y || (found.y == at.y && found.x < at.x) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return NONE;
}

var<workgroup> chosen: u32;

/// The block of this workgroup, NONE if there is nothing to do: the same for all of its threads.
fn choose(group: vec3u, t: u32) -> u32 {
    if t == 0u {
        let k = group.y * SPREAD + group.x;
        chosen = NONE;
        if k < params.count {
            let b = lists[params.first + k];
            if charts[blocks[b].chart].working != 0u {
                chosen = b;
            }
        }
    }
    return workgroupUniformLoad(&chosen);
}
