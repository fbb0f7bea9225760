// pyramid, first step: metrics of level 1, area-weighted over each node's dual cell. Reads 8 bytes and a triangle's
// tangents (24) per triangle and node, writes 12 per node.

/// Per node of level 1, its first entry; one more at the end.
@group(0) @binding(10) var<storage, read> starts: array<u32>;
/// Triangle, and the bits of its share.
@group(0) @binding(11) var<storage, read> entries: array<vec2u>;
@group(0) @binding(12) var<storage, read_write> metric: array<f32>;

@compute @workgroup_size(64)
fn pyramid_gather(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    for (var colour = 0u; colour < 4u; colour++) {
        let s = own_slot(colour, t);
        let node = b * NODES + s;
        var sum = vec3f();
        for (var k = starts[node]; k < starts[node + 1u]; k++) {
            let p = triangles[entries[k].x].pose;
            let x = vec3f(p[3], p[4], p[5]);
            let y = vec3f(p[6], p[7], p[8]);
            sum += bitcast<f32>(entries[k].y) * vec3f(dot(x, x), dot(x, y), dot(y, y));
        }
        // Per level-1 cell, which is two cells long.
        sum *= 4.0;
        let to = b * 3u * NODES + s;
        metric[to] = sum.x;
        metric[to + NODES] = sum.y;
        metric[to + 2u * NODES] = sum.z;
    }
}
