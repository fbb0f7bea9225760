// pyramid, level 1: metrics as the area-weighted mean of the triangles' metrics over each node's dual cell (method §3).
// Reads 8 bytes per triangle and node, 4 per node, and a triangle's tangents (24) per triangle; writes 12 per node.

/// Per node of level 1, the index of its first entry, followed by the number of entries.
@group(0) @binding(10) var<storage, read> starts: array<u32>;
/// Triangle index, and the fraction of the node's covered area as the bits of an f32.
@group(0) @binding(11) var<storage, read> entries: array<vec2u>;
@group(0) @binding(12) var<storage, read_write> metric: array<f32>;

@compute @workgroup_size(256)
fn pyramid_gather(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    let node = b * NODES + t;
    var sum = vec3f();
    for (var k = starts[node]; k < starts[node + 1u]; k++) {
        let p = triangles[entries[k].x].pose;
        let x = vec3f(p[3], p[4], p[5]);
        let y = vec3f(p[6], p[7], p[8]);
        sum += bitcast<f32>(entries[k].y) * vec3f(dot(x, x), dot(x, y), dot(y, y));
    }
    // Convert to cells of level 1, which are twice as long as those of level 0.
    sum *= 4.0;
    let to = b * 3u * NODES + t;
    metric[to] = sum.x;
    metric[to + NODES] = sum.y;
    metric[to + 2u * NODES] = sum.z;
}
