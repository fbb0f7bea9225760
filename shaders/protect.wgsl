// protect, levels 1 and above: how much of its weight rigid material loses where the pose alone strains it (method §4,
// Protection). Reads 12 bytes of each of 5 nodes and 8 of constants per node, writes 4.

/// The constants of the level's nodes.
@group(0) @binding(10) var<storage, read_write> weakened: array<u32>;

/// The mean square of the strain of the edges that the node at slot s of block b owns, between nodes with a metric.
fn strain_square(b: u32, s: u32) -> f32 {
    let floor = charts[blocks[b].chart].length_floor * params.scale;
    let near = metric_at(b, s);
    var sum = 0.0;
    var count = 0.0;
    for (var e = 0u; e < 4u; e++) {
        let d = offset(e);
        let source = window_source(vec2u(vec2i(node_at(s)) + 1 + d));
        let holder = blocks[b].neighbours[source.x];
        if holder == NONE {
            continue;
        }
        let far = metric_at(holder, source.y);
        let code = (weakened[node_index(b, LENGTH + e / 2u, s)] >> (16u * (e & 1u))) & 0xffffu;
        let rest = decode_length(code, blocks[b].length_base[e], blocks[b].length_shift[e]);
        if rest > 0.0 && near.x > 0.0 && far.x > 0.0 {
            let g = (near + far) * 0.5;
            let x = vec2f(d);
            let along = vec2f(g.x * x.x + g.y * x.y, g.y * x.x + g.z * x.y);
            let length = sqrt(max(along.x * x.x + along.y * x.y, 0.0));
            let strain = (length - rest) / max(rest, floor);
            sum += strain * strain;
            count += 1.0;
        }
    }
    return sum / max(count, 1.0);
}

@compute @workgroup_size(256)
fn protect(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    let square = strain_square(b, t);
    let lost = u32(params.factor * (square / (square + PROTECTED_STRAIN * PROTECTED_STRAIN)) + 0.5);
    let at = node_index(b, RIGIDITY, t);
    weakened[at] = (weakened[at] & 0x8000ffffu) | (lost << 16u);
}
