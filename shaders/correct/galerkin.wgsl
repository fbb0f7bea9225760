// correct: the coarser level's system, the Galerkin product P' A P (method §7.4), with nine points per node and
// symmetric again. P has the weights of method §7.5 (crates/core/src/grid/interpolation.rs). A coarse node reads from
// the rows of up to 25 finer nodes (44 bytes each, and 1 of weights; counting each finer node once, 180 bytes per
// coarse node) and writes 52 bytes.

@group(0) @binding(10) var<storage, read> fine_blocks: array<BlockRecord>;
@group(0) @binding(11) var<storage, read> fine_rows: array<u32>;

/// For each of the four finer blocks, the blocks around it as in its `active_neighbours`.
var<workgroup> holders: array<u32, 36>;

/// The weights ω of the lower neighbours at the fine nodes from (-2, -2) to (32, 32), in rows of 35.
var<workgroup> weights: array<f32, 1225>;

fn load_holders(b: u32, t: u32) {
    if t < 36u {
        let child = blocks[b].children[t / 9u];
        holders[t] = NONE;
        if child != NONE {
            holders[t] = fine_blocks[child].active_neighbours[t % 9u];
        }
    }
    workgroupBarrier();
}

fn load_weights(t: u32) {
    for (var k = t; k < 1225u; k += NODES) {
        let n = vec2i(i32(k % 35u), i32(k / 35u)) - 2;
        // A node next to several of the four is the same one for each of them; one that is missing has no neighbours.
        var source = vec2u(NONE, 0u);
        for (var quarter = 0u; quarter < 4u; quarter++) {
            let f = n - 16 * vec2i(vec2u(quarter & 1u, quarter >> 1u));
            if source.x == NONE && all(f >= vec2i(-16)) && all(f < vec2i(32)) {
                let shifted = vec2u(f + 16);
                let holder = holders[quarter * 9u + shifted.y / 16u * 3u + shifted.x / 16u];
                source = vec2u(holder, slot(shifted.x % 16u, shifted.y % 16u));
            }
        }
        weights[k] = 0.0;
        if source.x != NONE {
            weights[k] = weight_in_word(fine_blocks[source.x].weights[source.y / 4u], source.y);
        }
    }
    workgroupBarrier();
}

/// The weight at a fine node relative to the coarse block's first.
fn weight_at(n: vec2i) -> f32 {
    return weights[u32((n.y + 2) * 35 + n.x + 2)];
}

/// Starts in `fine_rows` of the rows of the fine nodes (x + i, y) of a line, i from -2 to 2; NONE where there
/// are none.
struct Line {
    at: vec4u,
    last: u32,
}

/// The line of fine nodes around (x, y), from (0, -2) to (14, 16), relative to the finer block `quarter` of the four.
fn line(quarter: u32, x: u32, y: i32) -> Line {
    let row = u32(y + 16);
    let in_y = slot(0u, row % 16u);
    let holder = quarter * 9u + row / 16u * 3u;
    // The nodes at x - 2 and x - 1 may lie in the block to the west, that at x + 2 in the one to the east.
    let west = holders[holder + (x + 14u) / 16u];
    let own = holders[holder + 1u];
    let east = holders[holder + (x + 18u) / 16u];
    let at = vec4u(west, west, own, own) * (ROW_PLANES * NODES) + in_y
        + vec4u(slot((x + 14u) % 16u, 0u), slot((x + 15u) % 16u, 0u), slot(x, 0u), slot(x + 1u, 0u));
    let found = vec4<bool>(vec2<bool>(west != NONE), vec2<bool>(own != NONE));
    let last = east * (ROW_PLANES * NODES) + in_y + slot((x + 2u) % 16u, 0u);
    return Line(select(vec4u(NONE), at, found), select(NONE, last, east != NONE));
}

/// The 2x2 diagonal block of a fine row, row-major.
fn diagonal_at(at: u32) -> vec4f {
    if at == NONE {
        return vec4f();
    }
    let xy = bitcast<f32>(fine_rows[at + NODES]);
    return vec4f(bitcast<f32>(fine_rows[at]), xy, xy, bitcast<f32>(fine_rows[at + 2u * NODES]));
}

/// The pair of a fine row's node with the neighbour along its edge e, row-major.
fn pair_at(at: u32, e: u32) -> vec4f {
    if at == NONE {
        return vec4f();
    }
    let pair = at + (PAIR + 2u * e) * NODES;
    return decode(vec2u(fine_rows[pair], fine_rows[pair + NODES]));
}

/// The weight of a coarse node in the interpolation of the fine node `by` rows above it, where `weight` is that node's.
fn part_of_node(by: i32, weight: f32) -> f32 {
    return select(select(weight, 1.0 - weight, by < 0), 1.0, by == 0);
}

/// Sums over the fine nodes of three rows around a coarse node, weighted by P, of their pairs with the five nodes of a
/// row.
struct RowSums {
    a: vec4f,
    b: vec4f,
    c: vec4f,
    d: vec4f,
    e: vec4f,
}

/// Adds what three nodes of a fine row, with the weights `low`, `own` and `high`, have with the row `up` (-1 to 1)
/// above it. The lower one of the two rows owns the pairs between them: `owner` is its line.
fn add_row(sums: ptr<function, RowSums>, owner: Line, up: i32, low: f32, own: f32, high: f32) {
    let at = owner.at;
    if up == 0 {
        let to_east_0 = pair_at(at.x, 0u);
        let to_east_1 = pair_at(at.y, 0u);
        let to_east_2 = pair_at(at.z, 0u);
        let to_east_3 = pair_at(at.w, 0u);
        (*sums).a += low * to_east_0.xzyw;
        (*sums).b += low * diagonal_at(at.y) + own * to_east_1.xzyw;
        (*sums).c += low * to_east_1 + own * diagonal_at(at.z) + high * to_east_2.xzyw;
        (*sums).d += own * to_east_2 + high * diagonal_at(at.w);
        (*sums).e += high * to_east_3;
    } else if up > 0 {
        (*sums).a += low * pair_at(at.y, 3u);
        (*sums).b += low * pair_at(at.y, 1u) + own * pair_at(at.z, 3u);
        (*sums).c += low * pair_at(at.y, 2u) + own * pair_at(at.z, 1u) + high * pair_at(at.w, 3u);
        (*sums).d += own * pair_at(at.z, 2u) + high * pair_at(at.w, 1u);
        (*sums).e += high * pair_at(at.w, 2u);
    } else {
        (*sums).a += low * pair_at(at.x, 2u).xzyw;
        (*sums).b += low * pair_at(at.y, 1u).xzyw + own * pair_at(at.y, 2u).xzyw;
        (*sums).c += low * pair_at(at.z, 3u).xzyw + own * pair_at(at.z, 1u).xzyw + high * pair_at(at.z, 2u).xzyw;
        (*sums).d += own * pair_at(at.w, 3u).xzyw + high * pair_at(at.w, 1u).xzyw;
        (*sums).e += high * pair_at(owner.last, 3u).xzyw;
    }
}

/// Entries of P in one dimension: between the fine node at `g`, from -2 to 2, and the coarse nodes at -2, 0 and 2.
fn interpolation(g: i32, weight: f32) -> vec3f {
    let rest = 1.0 - weight;
    if (g & 1) != 0 {
        return select(vec3f(0.0, weight, rest), vec3f(weight, rest, 0.0), g < 0);
    }
    return vec3f(vec3i(g) == vec3i(-2, 0, 2));
}

/// Writes the pair with neighbour e, if the node owns it, and returns its rounding error. Only pairs of two movable
/// nodes count.
fn finish_pair(b: u32, s: u32, is_movable: bool, e: u32, sum: vec4f) -> vec3f {
    let far = vec2u(vec2i(node_at(s)) + offset(e) + 1);
    let source = window_source(far);
    let holder = blocks[b].active_neighbours[source.x];
    let both = is_movable && holder != NONE && !is_fixed(select(b, holder, holder != NONE), source.y);
    let pair = select(vec4f(), sum, both);
    if e < 4u {
        let words = encode(pair);
        let at = row_index(b, PAIR + 2u * e, s);
        rows[at] = words.x;
        rows[at + NODES] = words.y;
    }
    return rounding_loss(pair, e);
}

@compute @workgroup_size(256)
fn galerkin(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) s: u32) {
    let b = block_of_workgroup(group, s);
    if b == NONE {
        return;
    }
    load_holders(b, s);
    load_weights(s);
    let n = node_at(s);
    let quarter = n.y / 8u * 2u + n.x / 8u;
    let is_movable = !is_fixed(b, s) && blocks[b].children[quarter] != NONE;
    // The blocks of the coarse pairs with the neighbours in the west, the same column and the east, from south to
    // north.
    var west: array<vec4f, 3>;
    var middle: array<vec4f, 3>;
    var east: array<vec4f, 3>;
    if is_movable {
        let centre = 2u * (n % 8u);
        let first = vec2i(2u * n);
        // P interpolates in x along the rows of fine nodes, then in y along the coarse columns; so does this, row gy by
        // row.
        for (var gy = -2; gy < 3; gy++) {
            var sums = RowSums();
            for (var fy = max(gy - 1, -1); fy < min(gy + 2, 2); fy++) {
                let in_y = part_of_node(fy, weight_at(first + vec2i(0, fy)));
                let low = in_y * (1.0 - weight_at(first + vec2i(-1, fy)));
                let high = in_y * weight_at(first + vec2i(1, fy));
                add_row(&sums, line(quarter, centre.x, i32(centre.y) + min(fy, gy)), gy - fy, low, in_y, high);
            }
            let west_weight = weight_at(first + vec2i(-1, gy));
            let east_weight = weight_at(first + vec2i(1, gy));
            let to_west = sums.a + west_weight * sums.b;
            let to_middle = (1.0 - west_weight) * sums.b + sums.c + east_weight * sums.d;
            let to_east = (1.0 - east_weight) * sums.d + sums.e;
            let in_west = interpolation(gy, weight_at(first + vec2i(-2, gy)));
            let in_middle = interpolation(gy, weight_at(first + vec2i(0, gy)));
            let in_east = interpolation(gy, weight_at(first + vec2i(2, gy)));
            west[0] += in_west.x * to_west;
            west[1] += in_west.y * to_west;
            west[2] += in_west.z * to_west;
            middle[0] += in_middle.x * to_middle;
            middle[1] += in_middle.y * to_middle;
            middle[2] += in_middle.z * to_middle;
            east[0] += in_east.x * to_east;
            east[1] += in_east.y * to_east;
            east[2] += in_east.z * to_east;
        }
    }
    var diagonal = vec3f(1.0, 0.0, 1.0);
    if is_movable {
        diagonal = middle[1].xyw;
    }
    diagonal += finish_pair(b, s, is_movable, 0u, east[1]);
    diagonal += finish_pair(b, s, is_movable, 1u, middle[2]);
    diagonal += finish_pair(b, s, is_movable, 2u, east[2]);
    diagonal += finish_pair(b, s, is_movable, 3u, west[2]);
    diagonal += finish_pair(b, s, is_movable, 4u, west[1]);
    diagonal += finish_pair(b, s, is_movable, 5u, middle[0]);
    diagonal += finish_pair(b, s, is_movable, 6u, west[0]);
    diagonal += finish_pair(b, s, is_movable, 7u, east[0]);
    let at = row_index(b, 0u, s);
    for (var c = 0u; c < 3u; c++) {
        rows[at + c * NODES] = bitcast<u32>(diagonal[c]);
    }
}
