// harm: the squares of the strain of edges inside of painted features, piece by piece (method §4, Harm). Per node it
// reads what energy reads and 2 bytes, and 44 bytes per triangle; per piece it writes 4.

/// Per piece, the sum without a warp; then the same with the present state.
@group(0) @binding(11) var<storage, read_write> squares: array<f32>;

const PATCH_THREADS: u32 = 256u;

/// The squares of the edges that node n owns inside of its feature.
fn square_of(n: vec2u, tag: u32, floor: f32) -> f32 {
    var sum = 0.0;
    let near = place_at(n, vec2i());
    for (var e = 0u; e < 4u; e++) {
        let d = offset(e);
        let far = place_at(n, d);
        let value = patch_value[near].xyz;
        let other = patch_value[far].xyz;
        if ((tag >> (8u + e)) & 1u) == 1u && (TANGENTS || (value.x > 0.0 && other.x > 0.0)) {
            let moved = (patch_u[far] - patch_u[near]) + vec2f(d);
            let length = patch_length[near][e];
            let posed = chord(value, mat2x3f(vec3f(), vec3f()), other, false, moved).length;
            let strain = (posed - length) / max(length, floor);
            // Not a number counts as 1.
            sum += select(1.0, strain * strain, strain * strain < 1.0);
        }
    }
    return sum;
}

@compute @workgroup_size(256)
fn sum_squares(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) s: u32) {
    let b = block_of_workgroup(group, s);
    if b == NONE {
        return;
    }
    let first = first_piece(b);
    let count = first_piece(b + 1u) - first;
    if count == 0u {
        return;
    }
    load_patch(b, s);
    let tag = tag_at(b, s);
    let sum = square_of(node_at(s), tag, charts[blocks[b].chart].length_floor * params.scale);
    // The sums take the memory of the patch.
    workgroupBarrier();
    patch_u[s] = vec2f(sum, f32(tag & 0xffu));
    workgroupBarrier();
    if s < count {
        var total = 0.0;
        for (var k = 0u; k < NODES; k++) {
            total += select(0.0, patch_u[k].x, patch_u[k].y == f32(s + 1u));
        }
        squares[params.mode * features[1] + first + s] = total;
    }
}
