// correct: the coarser level's system, the Galerkin product P' A P (method §7.4), with nine points per node and
// symmetric again. P has the weights of method §7.5 (crates/core/src/grid/interpolation.rs). A coarse node reads from the rows of
// up to 25 finer nodes (44 bytes each, and 1 of weights; counting each finer node once, 180 bytes per coarse node) and
// writes 52 bytes.

@group(0) @binding(10) var<storage, read> fine_blocks: array<BlockRecord>;

/// For each of the four finer blocks, the blocks around it as in its `active_neighbours`.
var<workgroup> holders: array<u32, 36>;

/// The weights ω of the lower neighbours at the fine nodes from (-2, -2) to (32, 32), in rows of 35.
var<workgroup> weights: array<f32, 1225>;

/// The holder and the slot of the fine node f, relative to the finer block `quarter` of the four.
fn fine_source(quarter: u32, f: vec2i) -> vec2u {
    let shifted = vec2u(f + 16);
    let holder = holders[quarter * 9u + shifted.y / 16u * 3u + shifted.x / 16u];
    return vec2u(holder, slot(shifted.x % 16u, shifted.y % 16u));
}

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
                source = fine_source(quarter, f);
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

/// Entries of P in one dimension: between the fine node at `g`, from -2 to 2, and the coarse nodes at -2, 0 and 2.
fn interpolation(g: i32, weight: f32) -> vec3f {
    let rest = 1.0 - weight;
    if (g & 1) != 0 {
        return select(vec3f(0.0, weight, rest), vec3f(weight, rest, 0.0), g < 0);
    }
    return vec3f(vec3i(g) == vec3i(-2, 0, 2));
}

/// The 2x2 block of A at the fine nodes f (row) and f + d (column), row-major.
fn fine_entry(quarter: u32, f: vec2i, d: vec2i) -> vec4f {
    let neighbour_owns = d.y < 0 || (d.y == 0 && d.x < 0);
    let source = fine_source(quarter, select(f, f + d, neighbour_owns));
    if source.x == NONE {
        return vec4f();
    }
    let at = (params.other_base + source.x) * ROW_PLANES * NODES + source.y;
    if all(d == vec2i()) {
        let xy = bitcast<f32>(fine_row_value(at + NODES));
        return vec4f(bitcast<f32>(fine_row_value(at)), xy, xy, bitcast<f32>(fine_row_value(at + 2u * NODES)));
    }
    // The number of the edge: the inverse of `offset`.
    let o = select(d, -d, neighbour_owns);
    let edge = select(select(select(3u, 2u, o.x > 0), 1u, o.x == 0), 0u, o.y == 0);
    let pair = at + (PAIR + 2u * edge) * NODES;
    let a = decode(vec2u(fine_row_value(pair), fine_row_value(pair + NODES)));
    return select(a, a.xzyw, neighbour_owns);
}

/// Writes the pair with neighbour e, if the node owns it, and returns its rounding error. Only pairs of two movable nodes
/// count.
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
    return rounding_loss(pair);
}

@compute @workgroup_size(256)
fn galerkin(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) s: u32) {
    let b = block_of_workgroup(group, s);
    if b == NONE {
        return;
    }
    load_holders(b, s);
    load_weights(s);
    // model: near
    let n = node_at(s);
    let quarter = n.y / 8u * 2u + n.x / 8u;
    let is_movable = !is_fixed(b, s) && blocks[b].children[quarter] != NONE;
    // The blocks of the coarse pairs with the neighbours in the west, the same column and the east, from south to north.
    var west: array<vec4f, 3>;
    var middle: array<vec4f, 3>;
    var east: array<vec4f, 3>;
    if is_movable {
        let centre = vec2i(2u * (n % 8u));
        let first = vec2i(2u * n);
        // P interpolates in x along the rows of fine nodes, then in y along the coarse columns; so does this.
        for (var fy = -1; fy < 2; fy++) {
            let in_middle_row = interpolation(fy, weight_at(first + vec2i(0, fy))).y;
            for (var gy = fy - 1; gy < fy + 2; gy++) {
                var to_west = vec4f();
                var to_middle = vec4f();
                var to_east = vec4f();
                for (var fx = -1; fx < 2; fx++) {
                    let from_middle = interpolation(fx, weight_at(first + vec2i(fx, fy))).y;
                    for (var gx = fx - 1; gx < fx + 2; gx++) {
                        let a = from_middle * fine_entry(quarter, centre + vec2i(fx, fy), vec2i(gx - fx, gy - fy));
                        let in_x = interpolation(gx, weight_at(first + vec2i(gx, gy)));
                        to_west += in_x.x * a;
                        to_middle += in_x.y * a;
                        to_east += in_x.z * a;
                    }
                }
                let in_west = in_middle_row * interpolation(gy, weight_at(first + vec2i(-2, gy)));
                let in_middle = in_middle_row * interpolation(gy, weight_at(first + vec2i(0, gy)));
                let in_east = in_middle_row * interpolation(gy, weight_at(first + vec2i(2, gy)));
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
