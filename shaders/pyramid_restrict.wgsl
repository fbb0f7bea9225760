// pyramid, level 2 and above: metrics as the coverage-weighted 3x3 Gaussian of the finer level's metrics (method §3).
// Reads 16 bytes of each of 9 finer nodes, writes 12 per node.

@group(0) @binding(10) var<storage, read> fine_blocks: array<BlockRecord>;
@group(0) @binding(11) var<storage, read> fine_nodes: array<u32>;
@group(0) @binding(12) var<storage, read> fine_metric: array<f32>;

@compute @workgroup_size(256)
fn pyramid_restrict(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    let n = node_at(t);
    let child = blocks[b].children[n.y / 8u * 2u + n.x / 8u];
    var sum = vec3f();
    var weights = 0.0;
    if child != NONE {
        for (var k = 0u; k < 9u; k++) {
            let d = vec2u(k % 3u, k / 3u);
            let source = window_source(2u * (n % 8u) + d);
            let holder = fine_blocks[child].neighbours[source.x];
            if holder != NONE {
                let kernel = select(0.25, 0.5, d.x == 1u) * select(0.25, 0.5, d.y == 1u);
                let weight = kernel * bitcast<f32>(fine_nodes[node_index(holder, TRIANGLE_OR_COVERAGE, source.y)]);
                let at = holder * 3u * NODES + source.y;
                sum += weight * vec3f(fine_metric[at], fine_metric[at + NODES], fine_metric[at + 2u * NODES]);
                weights += weight;
            }
        }
    }
    // Convert to cells of this level, which are twice as long.
    let value = select(vec3f(), 4.0 * sum / max(weights, TINY), weights > 0.0);
    let to = b * 3u * NODES + t;
    metric[to] = value.x;
    metric[to + NODES] = value.y;
    metric[to + 2u * NODES] = value.z;
}
