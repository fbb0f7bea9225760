// correct: the V-cycle on the way to coarser levels (method §7.4): smoothing from z = 0, one dispatch per block colour,
// and the restriction of the residual. Restriction reads 44 bytes of rows, 1 of weights and 16 of vectors per node (z
// half more and the others up to a quarter more for the halo of two nodes) and 4 of constants per coarse node, and
// writes 8 per coarse node.

/// Loads z of block b and its halo. With `from_zero`, z counts as 0 in the block itself and in blocks of the same or a
/// later colour, which this pass has not yet written.
fn load_direction(b: u32, t: u32, from_zero: bool) {
    let colour = block_colour(b);
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].active_neighbours[source.x];
        window_z[k] = vec2f();
        if holder != NONE && (!from_zero || block_colour(holder) < colour) {
            window_z[k] = vector(holder, DIRECTION, source.y);
        }
    }
    workgroupBarrier();
}

@compute @workgroup_size(64)
fn smooth_direction(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_direction(b, t, (params.mode & SMOOTH_FROM_ZERO) != 0u);
    sweep_block(b, t, (params.mode & SMOOTH_BACKWARDS) != 0u);
}

@group(0) @binding(10) var<storage, read> coarse_nodes: array<u32>;
@group(0) @binding(11) var<storage, read_write> coarse_vectors: array<f32>;

/// z at the nodes from (-2, -2) to (17, 17) of a block, a wide window of 20x20; r - A z at those from (-1, -1) to (15,
/// 15).
var<workgroup> wide_z: array<vec2f, 400>;
var<workgroup> residuals: array<vec2f, 289>;
/// The weights ω of the lower neighbours at the nodes of `residuals`.
var<workgroup> weights: array<f32, 289>;

/// Returns which of the 3x3 neighbour blocks holds node n of a block, n from -2 to 17, and the slot of the node there.
fn wide_source(n: vec2i) -> vec2u {
    let shifted = vec2u(n + 16);
    return vec2u(shifted.y / 16u * 3u + shifted.x / 16u, slot(shifted.x % 16u, shifted.y % 16u));
}

fn wide_place(n: vec2i) -> u32 {
    return u32((n.y + 2) * 20 + n.x + 2);
}

fn residual(b: u32, n: vec2i) -> vec2f {
    let own = wide_source(n);
    let holder = blocks[b].active_neighbours[own.x];
    if holder == NONE {
        return vec2f();
    }
    let d = diagonal(holder, own.y);
    let v = wide_z[wide_place(n)];
    // The order of the sum is that of multigrid_coarse.wgsl: a level's residual has the same bits in either.
    var sum = vec2f();
    for (var k = 0u; k < 8u; k++) {
        let far = n + offset(k);
        let source = wide_source(select(n, far, k > 3u));
        let owner = blocks[b].active_neighbours[source.x];
        if owner != NONE {
            sum += pair_times(row_index(owner, PAIR + 2u * (k & 3u), source.y), k, wide_z[wide_place(far)]);
        }
    }
    return vector(holder, RESIDUAL, own.y) - (sum + vec2f(d.x * v.x + d.y * v.y, d.y * v.x + d.z * v.y));
}

/// Writes the quarter of the coarser level's right-hand side that lies over this block: P' (r - A z) at movable nodes.
@compute @workgroup_size(64)
fn restrict_residual(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE || blocks[b].parent == NONE {
        return;
    }
    for (var k = t; k < 400u; k += 64u) {
        let source = wide_source(vec2i(i32(k % 20u), i32(k / 20u)) - 2);
        let holder = blocks[b].active_neighbours[source.x];
        wide_z[k] = vec2f();
        if holder != NONE {
            wide_z[k] = vector(holder, DIRECTION, source.y);
        }
    }
    workgroupBarrier();
    for (var k = t; k < 289u; k += 64u) {
        let n = vec2i(i32(k % 17u), i32(k / 17u)) - 1;
        residuals[k] = residual(b, n);
        let source = wide_source(n);
        let holder = blocks[b].active_neighbours[source.x];
        weights[k] = 0.0;
        if holder != NONE {
            weights[k] = interpolation_weight_at(holder, source.y);
        }
    }
    workgroupBarrier();
    let c = vec2u(t % 8u, t / 8u);
    // Restricted in x first, then in y.
    var lines: array<vec2f, 3>;
    for (var k = 0u; k < 3u; k++) {
        let at = (2u * c.y + k) * 17u + 2u * c.x;
        lines[k] = residuals[at + 1u] + ((1.0 - weights[at]) * residuals[at] + weights[at + 2u] * residuals[at + 2u]);
    }
    let below = 2u * c.y * 17u + 2u * c.x + 1u;
    let sum = lines[1] + ((1.0 - weights[below]) * lines[0] + weights[below + 34u] * lines[2]);
    let parent = blocks[b].parent;
    let s = slot(c.x + (blocks[b].x & 1u) * 8u, c.y + (blocks[b].y & 1u) * 8u);
    let fixed = (coarse_nodes[node_index(parent, RIGIDITY, s)] >> 31u) != 0u;
    let at = ((params.other_base + parent) * VECTOR_PLANES + RESIDUAL) * NODES + s;
    coarse_vectors[at] = select(sum.x, 0.0, fixed);
    coarse_vectors[at + NODES] = select(sum.y, 0.0, fixed);
}
