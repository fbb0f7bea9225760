// surface: position of the first corner and tangents of each triangle in the pose, from the positions of its vertices
// (method §2). Per triangle it reads 12 bytes of corners, 36 of positions and 16 of the inverse UV edge matrix, and
// writes 36.

/// Per triangle, the indices of its three vertices.
@group(0) @binding(10) var<storage, read> corners: array<u32>;
/// Per vertex, three coordinates relative to the centre of its chart (method §1, Positions).
@group(0) @binding(11) var<storage, read> positions: array<f32>;

fn position(v: u32) -> vec3f {
    return vec3f(positions[3u * v], positions[3u * v + 1u], positions[3u * v + 2u]);
}

@compute @workgroup_size(64)
fn surface(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let at = (group.y * SPREAD + group.x) * 64u + t;
    if at >= params.items || charts[triangles[at].chart].solved == 0u {
        return;
    }
    let a = position(corners[3u * at]);
    let e1 = position(corners[3u * at + 1u]) - a;
    let e2 = position(corners[3u * at + 2u]) - a;
    let b = triangles[at].barycentric;
    let x = e1 * b[0] + e2 * b[2];
    let y = e1 * b[1] + e2 * b[3];
    triangles[at].pose = array<f32, 9>(a.x, a.y, a.z, x.x, x.y, x.z, y.x, y.y, y.z);
}
