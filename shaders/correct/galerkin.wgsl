// correct: the coarser level's system, the Galerkin product P' A P (method §7.4), with nine points per node and
// symmetric again. P has the weights of method §7.5 (src/grid/interpolation.rs). A coarse node reads from the rows of
// up to 25 finer nodes (44 bytes each, and 1 of weights; counting each finer node once, 180 bytes per coarse node) and
// writes 52 bytes.

@group(0) @binding(10) var<storage, read> fine_blocks: array<BlockRecord>;

/// Index in the finer level's rows of the first plane of the node at f, relative to the fine block `child`, or NONE.
fn fine_row(child: u32, f: vec2i) -> u32 {
    let shifted = vec2u(f + 16);
    let holder = fine_blocks[child].active_neighbours[shifted.y / 16u * 3u + shifted.x / 16u];
    if holder == NONE {
        return NONE;
    }
    return (params.other_base + holder) * ROW_PLANES * NODES + slot(shifted.x % 16u, shifted.y % 16u);
}

/// The weight ω of the lower neighbour at the fine node f.
fn fine_weight(child: u32, f: vec2i) -> f32 {
    let shifted = vec2u(f + 16);
    let holder = fine_blocks[child].active_neighbours[shifted.y / 16u * 3u + shifted.x / 16u];
    if holder == NONE {
        return 0.0;
    }
    let s = slot(shifted.x % 16u, shifted.y % 16u);
    return weight_in_word(fine_blocks[holder].weights[s / 4u], s);
}

/// Entry of P between the fine node f and the coarse node that coincides with the fine node c.
fn interpolation(child: u32, f: vec2i, c: vec2i) -> f32 {
    let d = f - c;
    if any(abs(d) > vec2i(1)) {
        return 0.0;
    }
    var weight = 1.0;
    if d.x != 0 {
        let west = fine_weight(child, f);
        weight = select(1.0 - west, west, d.x > 0);
    }
    if d.y != 0 {
        let south = fine_weight(child, vec2i(c.x, f.y));
        weight *= select(1.0 - south, south, d.y > 0);
    }
    return weight;
}

/// The 2x2 block of A at the fine nodes f (row) and f + offset(k) (column), row-major; k = 8 is the diagonal.
fn fine_entry(child: u32, f: vec2i, k: u32) -> vec4f {
    if k == 8u {
        let at = fine_row(child, f);
        if at == NONE {
            return vec4f();
        }
        let xy = bitcast<f32>(fine_row_value(at + NODES));
        return vec4f(bitcast<f32>(fine_row_value(at)), xy, xy, bitcast<f32>(fine_row_value(at + 2u * NODES)));
    }
    let neighbour_owns = k > 3u;
    let at = fine_row(child, select(f, f + offset(k), neighbour_owns));
    if at == NONE {
        return vec4f();
    }
    let pair = at + (PAIR + 2u * (k & 3u)) * NODES;
    let a = decode(vec2u(fine_row_value(pair), fine_row_value(pair + NODES)));
    return select(a, a.xzyw, neighbour_owns);
}

@compute @workgroup_size(64)
fn galerkin(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    for (var colour = 0u; colour < 4u; colour++) {
        let s = thread_slot(colour, t);
        galerkin_node(b, node_at(s), s);
    }
}

fn galerkin_node(b: u32, n: vec2u, s: u32) {
    // The coarse blocks of the pairs with each of the eight neighbours, and the diagonal block.
    var sums: array<vec4f, 9>;
    let child = blocks[b].children[n.y / 8u * 2u + n.x / 8u];
    let is_movable = !is_fixed(b, s) && child != NONE;
    if is_movable {
        let centre = vec2i(2u * (n % 8u));
        for (var i = 0u; i < 9u; i++) {
            let f = vec2i(i32(i % 3u), i32(i / 3u)) - 1;
            let weight = interpolation(child, centre + f, centre);
            for (var k = 0u; k < 9u; k++) {
                var g = f;
                if k < 8u {
                    g += offset(k);
                }
                let a = weight * fine_entry(child, centre + f, k);
                for (var e = 0u; e < 9u; e++) {
                    var c = vec2i();
                    if e < 8u {
                        c = 2 * offset(e);
                    }
                    sums[e] += interpolation(child, centre + g, centre + c) * a;
                }
            }
        }
    }
    let at = row_index(b, 0u, s);
    var diagonal = vec3f(1.0, 0.0, 1.0);
    if is_movable {
        diagonal = vec3f(sums[8].x, sums[8].y, sums[8].w);
    }
    for (var e = 0u; e < 8u; e++) {
        // Only pairs of two movable nodes count.
        let far = vec2u(vec2i(n) + offset(e) + 1);
        let source = window_source(far);
        let holder = blocks[b].active_neighbours[source.x];
        let both = is_movable && holder != NONE && !is_fixed(select(b, holder, holder != NONE), source.y);
        let pair = select(vec4f(), sums[e], both);
        diagonal += rounding_loss(pair);
        if e < 4u {
            let words = encode(pair);
            rows[at + (PAIR + 2u * e) * NODES] = words.x;
            rows[at + (PAIR + 2u * e + 1u) * NODES] = words.y;
        }
    }
    for (var c = 0u; c < 3u; c++) {
        rows[at + c * NODES] = bitcast<u32>(diagonal[c]);
    }
}
