// Declarations common to all kernels: the buffers, and the mapping from threads to nodes (method §1, Blocks). The
// structs in the buffers and the constants are declared in generated.wgsl.
//
// A workgroup works on one block of 16x16 nodes. A plane holds one quantity at all nodes of a block, sorted by colour;
// a slot is the index of a node in a plane. Of 256 threads each has the node of its slot; of 64 threads, thread t works
// on the node in row t / 8 and column t % 8 of each of the four node colours in turn.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> charts: array<Chart>;
@group(0) @binding(2) var<storage, read> blocks: array<BlockRecord>;
@group(0) @binding(3) var<storage, read> lists: array<u32>;
/// Constants, per block: rigidity (a code of 16 bits; 15 bits of its multiplier in this pose; sign bit: fixed), four
/// rest lengths (codes of 16 bits in two words), triangle under the node (level 0) or coverage (coarser levels) and, on
/// grids that have it, density of rigid material or what holds nodes at open borders.
@group(0) @binding(4) var<storage, read> nodes: array<u32>;
/// State, per block: displacement (2) and, on level 0, triangle under W. The position or metric at W follows from these
/// and is computed where it is read (`value_at`). A fixed node has a displacement of 0, and its triangle is the one at
/// rest.
@group(0) @binding(5) var<storage, read_write> state: array<u32>;
/// Rows of the linear system, per block: diagonal (3), pairs of the owned edges (two words each, see `encode`).
@group(0) @binding(7) var<storage, read_write> rows: array<u32>;
/// Vectors of a correction, per block, in pairs of planes that hold different quantities one after the other
/// (layout.rs).
@group(0) @binding(8) var<storage, read_write> vectors: array<f32>;
/// Partial sums per quantity and active block: the block's part of its chart's sum.
@group(0) @binding(9) var<storage, read_write> partials: array<f32>;

/// Index in `partials` of block number `at` in quantity `quantity`, one of SUM_.
fn sum_index(quantity: u32, at: u32) -> u32 {
    return quantity * (arrayLength(&partials) / SUMS) + at;
}

/// Indices of plane `plane` of block b at slot s in `nodes`, `state`, `rows` and `vectors`.
fn node_index(b: u32, plane: u32, s: u32) -> u32 {
    return (b * params.node_planes + plane) * NODES + s;
}
fn state_index(b: u32, plane: u32, s: u32) -> u32 {
    return (b * params.state_planes + plane) * NODES + s;
}
fn row_index(b: u32, plane: u32, s: u32) -> u32 {
    return (b * ROW_PLANES + plane) * NODES + s;
}
fn vector_index(b: u32, plane: u32, s: u32) -> u32 {
    return (b * VECTOR_PLANES + plane) * NODES + s;
}

/// A word with two numbers (method §7.2): its lower half is y as bfloat16, its upper half such that the whole word as
/// f32 is next to x.
fn pack_two(x: f32, y: f32) -> u32 {
    // What is left of a sum that cancels must not decide how x is rounded: its sign may differ on the CPU.
    let bits = bitcast<u32>(select(y, 0.0, y * y <= x * x * 0x1p-36));
    let low = (bits + 0x7fffu + ((bits >> 16u) & 1u)) >> 16u;
    let whole = ((bitcast<u32>(x) - low + 0x8000u) & 0xffff0000u) | low;
    return select(whole, low, x * x <= 0.0);
}

fn unpack_two(word: u32) -> vec2f {
    return bitcast<vec2f>(vec2u(word, word << 16u));
}

/// Encodes a vector in one word. 0 stays 0: nodes at rest stay there.
fn encode_vector(v: vec2f) -> f32 {
    if all(v == vec2f()) {
        return 0.0;
    }
    // A word whose upper half is 0 would be a denormal number, which a GPU may take for 0.
    return bitcast<f32>(pack_two(select(TINY, v.x, abs(v.x) > TINY), v.y));
}

fn decode_vector(word: f32) -> vec2f {
    return unpack_two(bitcast<u32>(word));
}

/// Encodes a 2x2 block (row-major) as two words: (xx, xy), (yy, yx). The rounding error of a pair is added to the
/// diagonals of both of its nodes, so that the sum of each row stays exact.
fn encode(a: vec4f) -> vec2u {
    return vec2u(pack_two(a.x, a.y), pack_two(a.w, a.z));
}

fn decode(words: vec2u) -> vec4f {
    return vec4f(unpack_two(words.x), unpack_two(words.y).yx);
}

/// Returns (xx, xy, yy) of the symmetric part of the rounding error in `encode` of a node's pair with neighbour k. The
/// pair's owner encodes it.
fn rounding_loss(pair: vec4f, k: u32) -> vec3f {
    let a = select(pair, pair.xzyw, k > 3u);
    let rest = a - decode(encode(a));
    return vec3f(rest.x, 0.5 * (rest.y + rest.z), rest.w);
}

/// `code` / 65535, rounded to nearest as on the host (crates/core/src/grid/codes.rs), although WGSL's division need not
/// be. In binary the digits of the quotient repeat the code's digits, so rounding never meets a tie.
fn decode_rigidity(code: u32) -> f32 {
    let zeros = countLeadingZeros(code) - 16u;
    let digits = (code * 0x10001u) << zeros;
    let mantissa = (digits >> 8u) + ((digits >> 7u) & 1u);
    return bitcast<f32>(select(((125u - zeros) << 23u) + mantissa, 0u, code == 0u));
}

/// The code of a node's multiplier (method §4, Harm), a multiple of 1 / MULTIPLIER_STEPS, in its word of RIGIDITY.
fn multiplier_code(word: u32) -> u32 {
    return (word >> 16u) & 0x7fffu;
}

/// `code` / 254, rounded to nearest as on the host. A tie would need an odd multiple of 127 as twice the remainder, but
/// the only multiple of 127 among the codes from 128 to 254 is 254, whose remainder is 0.
fn decode_weight(code: u32) -> f32 {
    let zeros = countLeadingZeros(code) - 24u;
    let shifted = code << (zeros + 24u);
    let quotient = shifted / 254u;
    let mantissa = quotient + select(0u, 1u, shifted - quotient * 254u > 127u);
    return bitcast<f32>(select(((125u - zeros) << 23u) + mantissa, 0u, code == 0u));
}

/// The weight at slot s, where `word` is word s / 4 of a block's weights.
fn weight_in_word(word: u32, s: u32) -> f32 {
    return decode_weight((word >> (8u * (s & 3u))) & 0xffu);
}

/// The weight ω of the lower neighbour of the node at slot s of block b in the interpolation from the next coarser
/// level (method §7.5).
fn interpolation_weight_at(b: u32, s: u32) -> f32 {
    return weight_in_word(blocks[b].weights[s / 4u], s);
}

/// Decodes a length: its code has the leading bits of the f32 (crates/core/src/grid/codes.rs).
fn decode_length(code: u32, base: u32, shift: u32) -> f32 {
    return bitcast<f32>(select((code << shift) + base, 0u, code == 0u));
}

/// The code of the rest length of owned edge `e` of the node at slot s of block b.
fn length_code(b: u32, e: u32, s: u32) -> u32 {
    return (nodes[node_index(b, LENGTH + e / 2u, s)] >> (16u * (e & 1u))) & 0xffffu;
}

/// Slot of node (i, j) of a block.
fn slot(i: u32, j: u32) -> u32 {
    return ((j & 1u) * 2u + (i & 1u)) * 64u + (j >> 1u) * 8u + (i >> 1u);
}

/// Node (i, j) of a slot: the inverse of `slot`.
fn node_at(s: u32) -> vec2u {
    let colour = s / 64u;
    return vec2u(2u * (s % 8u) + (colour & 1u), 2u * (s / 8u % 8u) + (colour >> 1u));
}

/// Place of node (i - 1, j - 1) of a block in its window of 18x18 nodes. Rows follow one another, so that a node's
/// neighbours are at constant distances.
fn place(i: u32, j: u32) -> u32 {
    return j * 18u + i;
}

/// Node (i, j), both from 0 to 17, at place k of a window: the inverse of `place`.
fn window_node(k: u32) -> vec2u {
    return vec2u(k % 18u, k / 18u);
}

/// Returns which of the 3x3 neighbour blocks holds node n of a window (0 to 17), and the slot of the node there.
fn window_source(n: vec2u) -> vec2u {
    let by = (n + 15u) / 16u;
    let at = (n + 15u) % 16u;
    return vec2u(by.y * 3u + by.x, slot(at.x, at.y));
}

/// Offset of neighbour k of 8. k & 3 is the index of the edge; the neighbour owns the edge if k > 3, otherwise the
/// node.
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

/// Signs of the direction of quadrant q of 4.
fn quadrant(q: u32) -> vec2i {
    return vec2i(select(1, -1, (q & 1u) != 0u), select(1, -1, (q & 2u) != 0u));
}

fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

fn is_fixed(b: u32, s: u32) -> bool {
    return (nodes[node_index(b, RIGIDITY, s)] >> 31u) != 0u;
}

fn displacement(b: u32, s: u32) -> vec2f {
    if params.is_identity != 0u {
        return vec2f();
    }
    let at = state_index(b, U, s);
    return bitcast<vec2f>(vec2u(state[at], state[at + NODES]));
}

fn set_displacement(b: u32, s: u32, u: vec2f) {
    let at = state_index(b, U, s);
    state[at] = bitcast<u32>(u.x);
    state[at + NODES] = bitcast<u32>(u.y);
}

/// Slot of the node of colour k on which thread t works.
fn thread_slot(k: u32, t: u32) -> u32 {
    return k * 64u + t;
}

/// Coordinates in the level of the node at slot s of block b.
fn node_in_level(b: u32, s: u32) -> vec2i {
    return vec2i(vec2u(blocks[b].x, blocks[b].y) * 16u + node_at(s));
}

/// Returns the block that holds node (i, j) of the level for the chart of block b, or NONE.
fn block_holding(b: u32, i: i32, j: i32) -> u32 {
    let at = vec2i(i >> 4u, j >> 4u);
    let d = at - vec2i(i32(blocks[b].x), i32(blocks[b].y));
    if all(abs(d) <= vec2i(1)) {
        return blocks[b].neighbours[(d.y + 1) * 3 + d.x + 1];
    }
    return find_block(b, at);
}

/// Returns the block at block coordinates `at` of the chart of block b, or NONE. Binary search: a chart's blocks are
/// sorted by y, then x.
fn find_block(b: u32, at: vec2i) -> u32 {
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

/// True if kernels work on chart c now: in a correction, if the chart takes part in it; otherwise, if it is
/// solved.
fn is_at_work(c: u32) -> bool {
    return select(charts[c].working, charts[c].solved, params.in_correction == 0u) != 0u;
}

var<workgroup> workgroup_block: u32;

/// Returns the block of this workgroup, or NONE if the workgroup has no block or the block's chart is not at work.
/// Uniform: all threads of the workgroup get the same value.
fn block_of_workgroup(group: vec3u, t: u32) -> u32 {
    if t == 0u {
        let k = group.y * SPREAD + group.x;
        workgroup_block = NONE;
        if k < params.count {
            let b = lists[params.first + k];
            if is_at_work(blocks[b].chart) {
                workgroup_block = b;
            }
        }
    }
    return workgroupUniformLoad(&workgroup_block);
}
