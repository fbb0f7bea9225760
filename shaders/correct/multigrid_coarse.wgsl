// correct: the coarse end of the V-cycle (method §7.4), and all of conjugate gradients where the corrected level
// belongs to it. All levels on which every chart has few blocks are processed in one dispatch, with one workgroup per
// chart and four blocks at a time: on such levels separate dispatches would cost more than the work itself. The vectors
// and rows of these levels are stored one after the other in shared buffers.

@group(0) @binding(10) var<storage, read> coarse_blocks: array<CoarseBlock>;
/// Per chart and level: first (an index into this array) and count of the active blocks; then the blocks.
@group(0) @binding(11) var<storage, read> coarse_lists: array<u32>;
/// Contributions to the finest of these levels (restrict.wgsl).
@group(0) @binding(12) var<storage, read> contributed: array<vec2f>;

const BLOCKS_AT_ONCE: u32 = 4u;

var<workgroup> window_z: array<vec2f, 1296>;
var<workgroup> shared_range: vec2u;
var<workgroup> terms: array<f32, 256>;

fn stored_neighbour(b: u32, k: u32) -> u32 {
    return coarse_blocks[b].neighbours[k];
}

fn active_neighbour(b: u32, k: u32) -> u32 {
    return coarse_blocks[b].active_neighbours[k];
}

fn fixed_node(b: u32, s: u32) -> bool {
    return ((coarse_blocks[b].fixed[s / 32u] >> (s % 32u)) & 1u) != 0u;
}

/// Index of planes `plane` of block b; the scratch planes of all blocks are stored after their vectors.
fn place_of_vector(b: u32, plane: u32, s: u32) -> u32 {
    return select(vector_index(b, plane, s), (params.scratch + 2u * b) * NODES + s, plane == SCRATCH);
}

fn vector(b: u32, plane: u32, s: u32) -> vec2f {
    let at = place_of_vector(b, plane, s);
    if plane == LAST_STEP {
        return decode_vector(vectors[at]);
    }
    return vec2f(vectors[at], vectors[at + NODES]);
}

fn set_vector(b: u32, plane: u32, s: u32, v: vec2f) {
    let at = place_of_vector(b, plane, s);
    vectors[at] = v.x;
    vectors[at + NODES] = v.y;
}

/// First and count in `coarse_lists` of a chart's active blocks on a level. Uniform: all threads of the workgroup get the
/// same value.
fn block_range(c: u32, level: u32, t: u32) -> vec2u {
    if t == 0u {
        let at = (c * params.count + level) * 2u;
        shared_range = vec2u(coarse_lists[at], coarse_lists[at + 1u]);
    }
    return workgroupUniformLoad(&shared_range);
}

/// The sum of all threads' values. Uniform.
fn sum_of_threads(t: u32, value: f32) -> f32 {
    terms[t] = value;
    workgroupBarrier();
    for (var half = 128u; half > 0u; half /= 2u) {
        if t < half {
            terms[t] += terms[t + half];
        }
        workgroupBarrier();
    }
    return workgroupUniformLoad(&terms[0]);
}

fn load_window(b: u32, lane: u32, window: u32, plane: u32) {
    for (var k = lane; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = coarse_blocks[b].active_neighbours[source.x];
        window_z[window + k] = vec2f();
        if plane != NONE && holder != NONE {
            window_z[window + k] = vector(holder, plane, source.y);
        }
    }
}

/// Relaxes one node of a block, if there is one.
fn relax(works: bool, row: NodeRow, right: vec2f, s: u32, window: u32) {
    if works {
        let n = node_at(s);
        let z = solve_diagonal(row, right - row_times(row, n, window));
        window_z[window + place(n.x + 1u, n.y + 1u)] = z;
    }
    workgroupBarrier();
}

/// A pass of the smoother over a level, from the vector in planes `before` (NONE: from 0) to the vector in planes
/// `after`.
fn smooth_level(c: u32, level: u32, t: u32, before: u32, after: u32, backwards: bool) {
    let lane = t % 64u;
    let window = t / 64u * WINDOW;
    let slots = vec4u(0u, 64u, 128u, 192u) + lane;
    // The order of the colours.
    let order = select(slots, slots.wzyx, backwards);
    let range = block_range(c, level, t);
    for (var first = 0u; first < range.y; first += BLOCKS_AT_ONCE) { // model: 1 times
        let k = first + t / 64u;
        let works = k < range.y;
        let b = coarse_lists[range.x + min(k, range.y - 1u)];
        if works {
            load_window(b, lane, window, before);
        }
        let row_0 = load_row(b, order.x);
        let row_1 = load_row(b, order.y);
        let row_2 = load_row(b, order.z);
        let row_3 = load_row(b, order.w);
        let right_0 = vector(b, RESIDUAL, order.x);
        let right_1 = vector(b, RESIDUAL, order.y);
        let right_2 = vector(b, RESIDUAL, order.z);
        let right_3 = vector(b, RESIDUAL, order.w);
        workgroupBarrier();
        for (var sweep = 0u; sweep < params.sweeps; sweep++) {
            relax(works, row_0, right_0, order.x, window);
            relax(works, row_1, right_1, order.y, window);
            relax(works, row_2, right_2, order.z, window);
            relax(works, row_3, right_3, order.w, window);
        }
        for (var colour = 0u; colour < 4u && works; colour++) { // model: 4 times
            let s = thread_slot(colour, lane);
            let n = node_at(s);
            set_vector(b, after, s, window_z[window + place(n.x + 1u, n.y + 1u)]);
        }
        workgroupBarrier();
    }
    storageBarrier();
}

/// Sets SCRATCH to A z on a level, with the vector z in planes `plane`, or to r - A z if `subtracted`. Returns this
/// thread's part of z . A z.
fn multiply_level(c: u32, level: u32, t: u32, plane: u32, subtracted: bool) -> f32 {
    let lane = t % 64u;
    let window = t / 64u * WINDOW;
    let range = block_range(c, level, t);
    var sum = 0.0;
    for (var first = 0u; first < range.y; first += BLOCKS_AT_ONCE) { // model: 1 times
        let k = first + t / 64u;
        let works = k < range.y;
        let b = coarse_lists[range.x + min(k, range.y - 1u)];
        if works {
            load_window(b, lane, window, plane);
        }
        workgroupBarrier();
        for (var colour = 0u; colour < 4u && works; colour++) { // model: 4 times
            let s = thread_slot(colour, lane);
            let n = node_at(s);
            let row = load_row(b, s);
            let v = window_z[window + place(n.x + 1u, n.y + 1u)];
            let product = row_times(row, n, window) + diagonal_times(row, v);
            set_vector(b, SCRATCH, s, select(product, vector(b, RESIDUAL, s) - product, subtracted));
            sum += dot(v, product);
        }
        workgroupBarrier();
    }
    storageBarrier();
    return sum;
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

/// Restriction of t in x: the sum over the fine nodes n, n + (1, 0) and n + (2, 0) of the window of block b, of which
/// the middle one lies in a coarse column.
fn restrict_in_x(b: u32, n: vec2u) -> vec2f {
    let east = n + vec2u(2u, 0u);
    return window_vector(b, SCRATCH, n + vec2u(1u, 0u))
        + ((1.0 - interpolation_weight(b, n)) * window_vector(b, SCRATCH, n)
            + interpolation_weight(b, east) * window_vector(b, SCRATCH, east));
}

/// z of the coarser level at coarse column `column` (0 to 8) and fine row `row` of block b, interpolated in y only.
fn interpolate_in_y(b: u32, parent: u32, column: u32, row: u32) -> vec2f {
    let low = vec2u(coarse_blocks[b].colour & 1u, coarse_blocks[b].colour >> 1u) * 8u + vec2u(column, row / 2u) + 1u;
    let own = window_vector(parent, DIRECTION, low);
    if row % 2u == 0u {
        return own;
    }
    let weight = interpolation_weight(b, vec2u(2u * column + 1u, row + 1u));
    return own * weight + window_vector(parent, DIRECTION, low + vec2u(0u, 1u)) * (1.0 - weight);
}

/// Sets r to P' t, where t belongs to the next finer level.
fn restrict_level(c: u32, level: u32, t: u32) {
    let range = block_range(c, level, t);
    for (var k = t / 64u; k < range.y; k += BLOCKS_AT_ONCE) { // model: 1 times
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

/// Sets SCRATCH to z + P z, where P z comes from the next coarser level.
fn add_level(c: u32, level: u32, t: u32) {
    let range = block_range(c, level, t);
    for (var k = t / 64u; k < range.y; k += BLOCKS_AT_ONCE) { // model: 1 times
        let b = coarse_lists[range.x + k];
        let parent = coarse_blocks[b].parent;
        for (var colour = 0u; colour < 4u; colour++) {
            let s = thread_slot(colour, t % 64u);
            var add = vec2f();
            if parent != NONE && !fixed_node(b, s) {
                let n = node_at(s);
                add = interpolate_in_y(b, parent, n.x / 2u, n.y);
                if n.x % 2u == 1u {
                    let weight = weight_in_word(coarse_blocks[b].weights[s / 4u], s);
                    add = add * weight + interpolate_in_y(b, parent, n.x / 2u + 1u, n.y) * (1.0 - weight);
                }
            }
            set_vector(b, SCRATCH, s, vector(b, DIRECTION, s) + add);
        }
    }
    storageBarrier();
}

/// Sets z to M^-1 r by a V-cycle over the coarse levels from index `top` on: a pass of the smoother on each of them
/// downward, several on the coarsest, and one on each upward. The passes are those of one loop, since compilers insert
/// the code of a function wherever it is called.
fn cycle(c: u32, top: u32, t: u32) {
    let coarsest = params.count - 1u;
    let turn = coarsest - top;
    let rise = turn + 2u * COARSEST_ROUNDS;
    for (var k = 0u; k < rise + turn; k++) {
        var level = coarsest;
        // The last pass on the coarsest level writes the direction.
        let odd = ((k - turn) & 1u) != 0u;
        var before = select(select(DIRECTION, NONE, k == turn), SCRATCH, odd);
        var after = select(SCRATCH, DIRECTION, odd);
        if k < turn { // model: 1.0 * turn / (rise + turn) times
            level = top + k;
            before = NONE;
            after = DIRECTION;
        } else if k >= rise { // model: 1.0 * turn / (rise + turn) times
            level = coarsest - 1u - (k - rise);
            add_level(c, level, t);
            before = SCRATCH;
            after = DIRECTION;
        }
        smooth_level(c, level, t, before, after, k >= turn + COARSEST_ROUNDS);
        if k < turn { // model: 1.0 * turn / (rise + turn) times
            multiply_level(c, level, t, DIRECTION, true);
            restrict_level(c, level + 1u, t);
        }
    }
}

/// Sets the right-hand side of a level to the contributions of the finer level.
fn gather_level(c: u32, level: u32, t: u32) {
    let range = block_range(c, level, t);
    for (var k = t / 64u; k < range.y; k += BLOCKS_AT_ONCE) { // model: 1 times
        let b = coarse_lists[range.x + k];
        for (var colour = 0u; colour < 4u; colour++) {
            let s = thread_slot(colour, t % 64u);
            set_vector(b, RESIDUAL, s, select(arrived(b, vec2i(node_at(s))), vec2f(), fixed_node(b, s)));
        }
    }
    storageBarrier();
}

/// This thread's part of r . z; with `aside`, z is saved for the second V-cycle.
fn dot_level(c: u32, level: u32, t: u32, aside: bool) -> f32 {
    let range = block_range(c, level, t);
    var sum = 0.0;
    for (var k = t / 64u; k < range.y; k += BLOCKS_AT_ONCE) { // model: 1 times
        let b = coarse_lists[range.x + k];
        for (var colour = 0u; colour < 4u; colour++) {
            let s = thread_slot(colour, t % 64u);
            let z = vector(b, DIRECTION, s);
            sum += dot(vector(b, RESIDUAL, s), z);
            if aside {
                set_vector(b, SMOOTHED, s, z);
            }
        }
    }
    return sum;
}

/// Subtracts alpha A z0 from r.
fn advance(c: u32, level: u32, t: u32, alpha: f32) {
    let range = block_range(c, level, t);
    for (var k = t / 64u; k < range.y; k += BLOCKS_AT_ONCE) { // model: 1 times
        let b = coarse_lists[range.x + k];
        // A step of length 0 leaves r unchanged, even where the product is NaN.
        for (var colour = 0u; colour < 4u && alpha != 0.0; colour++) { // model: 4 times
            let s = thread_slot(colour, t % 64u);
            set_vector(b, RESIDUAL, s, vector(b, RESIDUAL, s) - alpha * vector(b, SCRATCH, s));
        }
    }
    storageBarrier();
}

/// Sets DIRECTION to z1 + beta z0.
fn second_direction(c: u32, level: u32, t: u32, beta: f32) {
    let range = block_range(c, level, t);
    for (var k = t / 64u; k < range.y; k += BLOCKS_AT_ONCE) { // model: 1 times
        let b = coarse_lists[range.x + k];
        for (var colour = 0u; colour < 4u && beta != 0.0; colour++) { // model: 4 times
            let s = thread_slot(colour, t % 64u);
            set_vector(b, DIRECTION, s, vector(b, DIRECTION, s) + beta * vector(b, SMOOTHED, s));
        }
    }
    storageBarrier();
}

/// The products of r1 with the last step p, and of A p with both directions and p.
fn products_of_last_step(c: u32, level: u32, t: u32) -> vec4f {
    let curvature = multiply_level(c, level, t, LAST_STEP, false);
    let range = block_range(c, level, t);
    var sums = vec3f();
    for (var k = t / 64u; k < range.y; k += BLOCKS_AT_ONCE) { // model: 1 times
        let b = coarse_lists[range.x + k];
        for (var colour = 0u; colour < 4u; colour++) {
            let s = thread_slot(colour, t % 64u);
            let product = vector(b, SCRATCH, s);
            sums += vec3f(
                dot(vector(b, RESIDUAL, s), vector(b, LAST_STEP, s)), dot(vector(b, SMOOTHED, s), product),
                dot(vector(b, DIRECTION, s), product)
            );
        }
    }
    let residual = sum_of_threads(t, sums.x);
    let first = sum_of_threads(t, sums.y);
    let second = sum_of_threads(t, sums.z);
    return vec4f(residual, first, second, sum_of_threads(t, curvature));
}

/// Copies both directions to the planes from which the step is formed.
fn put_back(c: u32, level: u32, t: u32) {
    let range = block_range(c, level, t);
    for (var k = t / 64u; k < range.y; k += BLOCKS_AT_ONCE) { // model: 1 times
        let b = coarse_lists[range.x + k];
        for (var colour = 0u; colour < 4u; colour++) {
            let s = thread_slot(colour, t % 64u);
            set_vector(b, RESIDUAL, s, vector(b, DIRECTION, s));
            set_vector(b, DIRECTION, s, vector(b, SMOOTHED, s));
        }
    }
}

/// The energy before the correction, which assembly stored block by block.
fn energy_before(c: u32, level: u32, t: u32) -> f32 {
    let range = block_range(c, level, t);
    var sum = 0.0;
    for (var k = t; k < range.y; k += 256u) { // model: 1 times
        sum += vectors[vector_index(coarse_lists[range.x + k], ENERGY_BEFORE, 0u)];
    }
    return sum_of_threads(t, sum);
}

/// One or two iterations of conjugate gradients on the coarse level with the index `level` (method §7.3); or, if `solves`
/// is not set, one V-cycle.
fn solve_level(c: u32, level: u32, t: u32, solves: bool, iterations: u32) {
    var before = 0.0;
    if solves {
        before = energy_before(c, level, t);
    }
    var rz = vec2f();
    var curvature = vec2f();
    var lengths = vec2f();
    for (var k = 0u; k < iterations; k++) {
        cycle(c, level, t);
        if !solves {
            return;
        }
        let is_first = k == 0u;
        let product = sum_of_threads(t, dot_level(c, level, t, is_first && iterations > 1u));
        if !is_first {
            let quotient = product / rz.x;
            second_direction(c, level, t, select(0.0, quotient, lengths.x != 0.0 && is_finite(quotient)));
        }
        let of_direction = sum_of_threads(t, multiply_level(c, level, t, DIRECTION, false));
        let length = step_length(product, of_direction);
        if is_first {
            rz.x = product;
            curvature.x = of_direction;
            lengths.x = length;
            if iterations > 1u {
                advance(c, level, t, length);
            }
        } else {
            rz.y = product;
            curvature.y = of_direction;
            lengths.y = length;
        }
    }
    var step = Combination(vec3f(lengths, 0.0), lengths.x * rz.x + lengths.y * rz.y);
    if iterations > 1u {
        if params.has_last_step == 1u {
            step = with_last_step(lengths, curvature, step.predicted, products_of_last_step(c, level, t));
        }
        put_back(c, level, t);
    }
    if t == 0u {
        charts[c].before = before;
        charts[c].step = array<f32, 3>(step.factors.x, step.factors.y, step.factors.z);
        charts[c].predicted = step.predicted;
    }
}

@compute @workgroup_size(256)
fn multigrid_coarse(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let c = group.y * SPREAD + group.x;
    // model: near
    if c >= params.items {
        return;
    }
    if t == 0u {
        workgroup_block = charts[c].working;
    }
    if workgroupUniformLoad(&workgroup_block) == 0u {
        return;
    }
    // `first` is the index of the level among the coarse levels.
    let solves = params.mode == COARSE_SOLVE || params.mode == COARSE_SOLVE_ONCE;
    if !solves {
        gather_level(c, params.first, t);
    }
    solve_level(c, params.first, t, solves, select(1u, 2u, params.mode == COARSE_SOLVE));
}
