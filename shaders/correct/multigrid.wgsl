// correct: the smoother of the preconditioner, and products with the matrix (method §7.4), on the stored rows. Per node
// a pass of the smoother reads 44 bytes of rows and 16 of vectors (up to a quarter more for the halo), and writes 8.

var<workgroup> window_z: array<vec2f, 324>;

fn block_colour(b: u32) -> u32 {
    return (blocks[b].y & 1u) * 2u + (blocks[b].x & 1u);
}

fn diagonal(b: u32, s: u32) -> vec3f {
    let at = row_index(b, 0u, s);
    return bitcast<vec3f>(vec3u(rows[at], rows[at + NODES], rows[at + 2u * NODES]));
}

fn vector(b: u32, plane: u32, s: u32) -> vec2f {
    let at = vector_index(b, plane, s);
    return vec2f(vectors[at], vectors[at + NODES]);
}

fn set_vector(b: u32, plane: u32, s: u32, v: vec2f) {
    let at = vector_index(b, plane, s);
    vectors[at] = v.x;
    vectors[at + NODES] = v.y;
}

/// A_pn v for neighbour k of a node; `at` is the index of the pair's first word in `rows`.
fn pair_times(at: u32, k: u32, v: vec2f) -> vec2f {
    let a = decode(vec2u(rows[at], rows[at + NODES]));
    let across = select(a.yz, a.zy, k > 3u);
    return vec2f(a.x * v.x + across.x * v.y, across.y * v.x + a.w * v.y);
}

/// The sum of A_pn v_n over the neighbours of node n, where the window holds v.
fn off_diagonal(b: u32, n: vec2u) -> vec2f {
    var sum = vec2f();
    for (var k = 0u; k < 8u; k++) {
        let far = vec2u(vec2i(n) + 1 + offset(k));
        let source = window_source(select(n + 1u, far, k > 3u));
        let owner = blocks[b].active_neighbours[source.x];
        if owner != NONE {
            sum += pair_times(row_index(owner, PAIR + 2u * (k & 3u), source.y), k, window_z[place(far.x, far.y)]);
        }
    }
    return sum;
}

fn place_of_slot(s: u32) -> u32 {
    let n = node_at(s);
    return place(n.x + 1u, n.y + 1u);
}

/// Gauss-Seidel sweeps of z towards A z = r over the node colours of block b. The window holds z; its halo stays
/// frozen.
fn sweep_block(b: u32, t: u32, backwards: bool) {
    for (var sweep = 0u; sweep < 4u * params.sweeps; sweep++) {
        let s = thread_slot(select(sweep & 3u, 3u - (sweep & 3u), backwards), t);
        let d = diagonal(b, s);
        let rest = vector(b, RESIDUAL, s) - off_diagonal(b, node_at(s));
        // A fixed node has r = 0 and no pairs: it stays at 0.
        window_z[place_of_slot(s)] =
            vec2f(d.z * rest.x - d.y * rest.y, d.x * rest.y - d.y * rest.x) / (d.x * d.z - d.y * d.y);
        workgroupBarrier();
    }
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        set_vector(b, DIRECTION, s, window_z[place_of_slot(s)]);
    }
}
