// What all stages share: the layout of the buffers (its Rust twin is src/gpu/layout.rs; a test compares them), and
// how a thread finds its node.
//
// A workgroup of 64 threads works on one block of 16x16 nodes; thread t is the node of row t / 8 and column t % 8 of
// each of the four colours in turn. A plane is one quantity at a block's nodes, colour after colour.

const NONE: u32 = 0xffffffffu;
const NODES: u32 = 256u;
const WINDOW: u32 = 324u;
const SPREAD: u32 = 65535u;

/// Corner Jacobians of a result are at least this.
const MIN_JACOBIAN: f32 = 0.02;
/// More than any energy: that of a state that is worth nothing.
const WORTHLESS: f32 = 3e38;
/// Keeps 1 / L finite; lengths of a chart of unit size are far longer.
const TINY: f32 = 1e-24;

/// One dispatch.
struct Params {
    /// The range of `lists` with the blocks to work on.
    first: u32,
    count: u32,
    /// Where the first of these blocks' sums go.
    partial: u32,
    /// A stage's own choice.
    mode: u32,
    sweeps: u32,
    /// Charts, or other things to work on.
    items: u32,
    /// Length of this level's cells, in those of level 0.
    scale: f32,
    /// Part of a step, or another factor.
    part: f32,
    tolerance: f32,
    smoothness: f32,
    smoothness_floor: f32,
    orientation: f32,
    room: f32,
    room_threshold: f32,
    level: u32,
    /// Where this level's blocks begin in `rows` and `vectors`, and the other level's in its own.
    base: u32,
    other_base: u32,
    /// Of the paper's solver: factor on a level's corrections, share of the rotation toward rest, share of a velocity that is
    /// kept, smoothing s of eq. 4.
    correction: f32,
    preservation: f32,
    momentum: f32,
    smoothing: f32,
    /// What orientation preservation grows by where rigid material is dense.
    orientation_density: f32,
}

/// A chart, and what is decided about it on the way.
struct Chart {
    /// 1 if it takes part in this solve.
    solve: u32,
    /// 1 if stages work on it now.
    working: u32,
    /// 1 if it sits out the level's further corrections.
    done: u32,
    /// 1 if the result is the identity because nothing better was found.
    fallback: u32,
    /// Floor of rest lengths on level 0.
    floor: f32,
    /// Energy of the identity, before the correction under way, and now.
    identity: f32,
    before: f32,
    energy: f32,
    /// Conjugate gradients.
    rz: f32,
    alpha: f32,
    beta: f32,
    /// By how much the quadratic model of the energy falls.
    predicted: f32,
    /// 1 during a level's first correction.
    first: u32,
    /// Share of the next correction's step that the chart is to take.
    next: f32,
    min_jacobian: f32,
    max_displacement: f32,
    folds: u32,
    /// Rounds of cutting the step under way that found folds.
    cuts: atomic<u32>,
}

struct Block {
    /// The 3x3 blocks of the same chart around it, itself in the middle; NONE where there is none.
    around: array<u32, 9>,
    /// The same without blocks that have no movable node.
    links: array<u32, 9>,
    chart: u32,
    x: u32,
    y: u32,
    /// 1 if it has a movable node.
    moves: u32,
    /// The block of the next coarser level that holds its even nodes.
    parent: u32,
    /// The blocks of the next finer level over its quarters.
    children: array<u32, 4>,
    /// Its chart's blocks here, sorted by y, then x.
    chart_first: u32,
    chart_count: u32,
    /// Bits: 1 if the chart goes on below what is held here, 2 if above.
    continues: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> charts: array<Chart>;
@group(0) @binding(2) var<storage, read> blocks: array<Block>;
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

const NODE_PLANES: u32 = 7u;
const RIGIDITY: u32 = 0u;
const LENGTH: u32 = 1u;
const UNDER: u32 = 5u;
const DENSITY: u32 = 6u;

const STATE_PLANES: u32 = 6u;
const U: u32 = 0u;
const VALUE: u32 = 2u;
const TRIANGLE: u32 = 5u;

const ROW_PLANES: u32 = 12u;
const PAIR: u32 = 3u;
const INTERPOLATION: u32 = 11u;

const VECTOR_PLANES: u32 = 8u;
const R: u32 = 0u;
const Z: u32 = 2u;
const T: u32 = 4u;
const X: u32 = 6u;
const SHARE: u32 = 0u;
const MARK: u32 = 4u;

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
        return blocks[b].around[(d.y + 1) * 3 + d.x + 1];
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
