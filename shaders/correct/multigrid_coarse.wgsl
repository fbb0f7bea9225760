// correct: the coarse end of the V-cycle (method §7.4). All levels on which no chart has many blocks are done in one
// dispatch, one workgroup per chart, four blocks at a time: on such levels dispatches of their own would cost more than
// the work. It computes what smooth_direction, restrict_residual and multigrid_up compute on finer levels. The vectors
// and rows of these levels stand one after the other in common buffers.

@group(0) @binding(10) var<storage, read> coarse_blocks: array<CoarseBlock>;
/// Per chart, level and block colour: first (an index into this array) and count of the active blocks; then the blocks.
@group(0) @binding(11) var<storage, read> coarse_lists: array<u32>;

const BLOCKS_AT_ONCE: u32 = 4u;

var<workgroup> windows_z: array<vec2f, 1296>;
var<workgroup> shared_range: vec2u;

fn fixed_node(b: u32, s: u32) -> bool {
    return ((coarse_blocks[b].fixed[s / 32u] >> (s % 32u)) & 1u) != 0u;
}

fn vector(b: u32, plane: u32, s: u32) -> vec2f {
    let at = vector_index(b, plane, s);
    return vec2f(vectors[at], vectors[at + NODES]);
}

fn set_vector(b: u32, plane: u32, s: u32, v: vec2f) {
    let at = vector_index(b, plane, s);
    vectors[at] = v.x;
    vectors[at + NODES] = v.y;
}

/// First and count in `coarse_lists` of a chart's active blocks on a level: of one colour, or of all (colour = 4).
/// Uniform: all threads of the workgroup get the same value.
fn block_range(c: u32, level: u32, colour: u32, t: u32) -> vec2u {
    if t == 0u {
        let at = ((c * params.count + level) * 4u + colour % 4u) * 2u;
        shared_range = vec2u(coarse_lists[at], coarse_lists[at + 1u]);
        if colour == 4u {
            // The lists of the four colours follow one another.
            shared_range.y += coarse_lists[at + 3u] + coarse_lists[at + 5u] + coarse_lists[at + 7u];
        }
    }
    return workgroupUniformLoad(&shared_range);
}

fn off_diagonal(b: u32, n: vec2u, window: u32) -> vec2f {
    var sum = vec2f();
    for (var k = 0u; k < 8u; k++) {
        let far = vec2u(vec2i(n) + 1 + offset(k));
        let neighbour_owns = k > 3u;
        let source = window_source(select(n + 1u, far, neighbour_owns));
        let owner = coarse_blocks[b].active_neighbours[source.x];
        if owner != NONE {
            let at = row_index(owner, PAIR + 2u * (k & 3u), source.y);
            let a = decode(vec2u(rows[at], rows[at + NODES]));
            let across = select(a.yz, a.zy, neighbour_owns);
            let v = windows_z[window + place(far.x, far.y)];
            sum += vec2f(a.x * v.x + across.x * v.y, across.y * v.x + a.w * v.y);
        }
    }
    return sum;
}

fn diagonal(b: u32, s: u32) -> vec3f {
    let at = row_index(b, 0u, s);
    return bitcast<vec3f>(vec3u(rows[at], rows[at + NODES], rows[at + 2u * NODES]));
}

fn load_window(b: u32, lane: u32, window: u32, from_zero: bool) {
    for (var k = lane; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = coarse_blocks[b].active_neighbours[source.x];
        windows_z[window + k] = vec2f();
        if holder != NONE && (!from_zero || coarse_blocks[holder].colour < coarse_blocks[b].colour) {
            windows_z[window + k] = vector(holder, DIRECTION, source.y);
        }
    }
}

fn smooth_level(c: u32, level: u32, t: u32, backwards: bool, from_zero: bool) {
    let lane = t % 64u;
    let window = t / 64u * WINDOW;
    for (var q = 0u; q < 4u; q++) {
        let range = block_range(c, level, select(q, 3u - q, backwards), t);
        for (var first = 0u; first < range.y; first += BLOCKS_AT_ONCE) {
            let k = first + t / 64u;
            let works = k < range.y;
            let b = coarse_lists[range.x + min(k, range.y - 1u)];
            if works {
                load_window(b, lane, window, from_zero);
            }
            workgroupBarrier();
            for (var sweep = 0u; sweep < 4u * params.sweeps; sweep++) {
                let s = thread_slot(select(sweep & 3u, 3u - (sweep & 3u), backwards), lane);
                let n = node_at(s);
                if works {
                    let d = diagonal(b, s);
                    let rest = vector(b, RESIDUAL, s) - off_diagonal(b, n, window);
                    windows_z[window + place(n.x + 1u, n.y + 1u)] =
                        vec2f(d.z * rest.x - d.y * rest.y, d.x * rest.y - d.y * rest.x) / (d.x * d.z - d.y * d.y);
                }
                workgroupBarrier();
            }
            for (var colour = 0u; colour < 4u && works; colour++) {
                let s = thread_slot(colour, lane);
                let n = node_at(s);
                set_vector(b, DIRECTION, s, windows_z[window + place(n.x + 1u, n.y + 1u)]);
            }
            workgroupBarrier();
        }
        storageBarrier();
    }
}

/// t = r - A z on a level.
fn residual_level(c: u32, level: u32, t: u32) {
    let lane = t % 64u;
    let window = t / 64u * WINDOW;
    let range = block_range(c, level, 4u, t);
    for (var first = 0u; first < range.y; first += BLOCKS_AT_ONCE) {
        let k = first + t / 64u;
        let works = k < range.y;
        let b = coarse_lists[range.x + min(k, range.y - 1u)];
        if works {
            load_window(b, lane, window, false);
        }
        workgroupBarrier();
        for (var colour = 0u; colour < 4u && works; colour++) {
            let s = thread_slot(colour, lane);
            let n = node_at(s);
            let d = diagonal(b, s);
            let v = windows_z[window + place(n.x + 1u, n.y + 1u)];
            let product = off_diagonal(b, n, window) + vec2f(d.x * v.x + d.y * v.y, d.y * v.x + d.z * v.y);
            set_vector(b, PRODUCT, s, vector(b, RESIDUAL, s) - product);
        }
        workgroupBarrier();
    }
    storageBarrier();
}

/// The vector in planes `plane` at node n (0 to 17) of the window of block b, which may be of any of these levels.
fn window_vector(b: u32, plane: u32, n: vec2u) -> vec2f {
    let source = window_source(n);
    let holder = coarse_blocks[b].active_neighbours[source.x];
    if holder == NONE {
        return vec2f();
    }
    return vector(holder, plane, source.y);
}

/// The weight ω of the lower neighbour at node n of the window of block b.
fn interpolation_weight(b: u32, n: vec2u) -> f32 {
    let source = window_source(n);
    let holder = coarse_blocks[b].active_neighbours[source.x];
    if holder == NONE {
        return 0.0;
    }
    return weight_in_word(coarse_blocks[holder].weights[source.y / 4u], source.y);
}

/// Restriction of t in x: the sum over the fine nodes n, n + (1, 0) and n + (2, 0) of the window of block b, the middle
/// one of which lies in a coarse column.
fn restrict_in_x(b: u32, n: vec2u) -> vec2f {
    let east = n + vec2u(2u, 0u);
    return window_vector(b, PRODUCT, n + vec2u(1u, 0u))
        + ((1.0 - interpolation_weight(b, n)) * window_vector(b, PRODUCT, n)
            + interpolation_weight(b, east) * window_vector(b, PRODUCT, east));
}

/// z of the coarser level at coarse column `column` (0 to 8) and fine row `row` of block b: interpolated in y alone.
fn interpolate_in_y(b: u32, parent: u32, column: u32, row: u32) -> vec2f {
    let low = vec2u(coarse_blocks[b].colour & 1u, coarse_blocks[b].colour >> 1u) * 8u + vec2u(column, row / 2u) + 1u;
    let own = window_vector(parent, DIRECTION, low);
    if row % 2u == 0u {
        return own;
    }
    let weight = interpolation_weight(b, vec2u(2u * column + 1u, row + 1u));
    return own * weight + window_vector(parent, DIRECTION, low + vec2u(0u, 1u)) * (1.0 - weight);
}

/// r = P' t, with t of the next finer level.
fn restrict_level(c: u32, level: u32, t: u32) {
    let range = block_range(c, level, 4u, t);
    for (var k = t / 64u; k < range.y; k += BLOCKS_AT_ONCE) {
        let b = coarse_lists[range.x + k];
        for (var colour = 0u; colour < 4u; colour++) {
            let s = thread_slot(colour, t % 64u);
            let n = node_at(s);
            let child = coarse_blocks[b].children[n.y / 8u * 2u + n.x / 8u];
            var sum = vec2f();
            if child != NONE && !fixed_node(b, s) {
                let at = 2u * (n % 8u);
                sum = restrict_in_x(child, at + vec2u(0u, 1u))
                    + ((1.0 - interpolation_weight(child, at + vec2u(1u, 0u))) * restrict_in_x(child, at)
                        + interpolation_weight(child, at + vec2u(1u, 2u)) * restrict_in_x(child, at + vec2u(0u, 2u)));
            }
            set_vector(b, RESIDUAL, s, sum);
        }
    }
    storageBarrier();
}

/// z += P z, with P z from the next coarser level.
fn add_level(c: u32, level: u32, t: u32) {
    let range = block_range(c, level, 4u, t);
    for (var k = t / 64u; k < range.y; k += BLOCKS_AT_ONCE) {
        let b = coarse_lists[range.x + k];
        let parent = coarse_blocks[b].parent;
        for (var colour = 0u; colour < 4u; colour++) {
            let s = thread_slot(colour, t % 64u);
            if parent != NONE && !fixed_node(b, s) {
                let n = node_at(s);
                var add = interpolate_in_y(b, parent, n.x / 2u, n.y);
                if n.x % 2u == 1u {
                    let weight = weight_in_word(coarse_blocks[b].weights[s / 4u], s);
                    add = add * weight + interpolate_in_y(b, parent, n.x / 2u + 1u, n.y) * (1.0 - weight);
                }
                set_vector(b, DIRECTION, s, vector(b, DIRECTION, s) + add);
            }
        }
    }
    storageBarrier();
}

/// z = M^-1 r: a V-cycle over the `count` coarse levels, from the `mode`-th of them on.
@compute @workgroup_size(256)
fn multigrid_coarse(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let c = group.y * SPREAD + group.x;
    if c >= params.items {
        return;
    }
    if t == 0u {
        workgroup_block = charts[c].working;
    }
    if workgroupUniformLoad(&workgroup_block) == 0u {
        return;
    }
    let coarsest = params.count - 1u;
    for (var level = params.mode; level < coarsest; level++) {
        smooth_level(c, level, t, false, true);
        residual_level(c, level, t);
        restrict_level(c, level + 1u, t);
    }
    for (var round = 0u; round < 2u * COARSEST_ROUNDS; round++) {
        smooth_level(c, coarsest, t, round >= COARSEST_ROUNDS, round == 0u);
    }
    for (var below = coarsest; below > params.mode; below--) {
        add_level(c, below - 1u, t);
        smooth_level(c, below - 1u, t, true, false);
    }
}
