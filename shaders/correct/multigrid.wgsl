// correct: the smoother of the preconditioner, and products with the matrix (method §7.4), on the stored rows. The
// smoother is additive over blocks: each block is smoothed with its halo frozen, independently of the others, so a pass
// over a level is one dispatch. Per node a pass reads 44 bytes of rows and 16 of vectors (up to a quarter more for the
// halo), and writes 8.

var<workgroup> window_z: array<vec2f, 324>;
/// The right-hand side at the slots of the block.
var<workgroup> right: array<vec2f, 256>;

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

fn is_inside(n: vec2i) -> bool {
    return all(n >= vec2i(0)) && all(n < vec2i(16));
}

/// The sum of A_pn v_n over the neighbours of node n, from (-1, -1) to (16, 16), where the window holds v. With
/// `inside`, v is taken to be 0 outside the block.
fn off_diagonal(b: u32, n: vec2i, inside: bool) -> vec2f {
    var sum = vec2f();
    for (var k = 0u; k < 8u; k++) {
        let far = n + offset(k);
        if !inside || is_inside(far) {
            let source = window_source(vec2u(select(n, far, k > 3u) + 1));
            let owner = blocks[b].active_neighbours[source.x];
            if owner != NONE {
                let at = row_index(owner, PAIR + 2u * (k & 3u), source.y);
                sum += pair_times(at, k, window_z[place(u32(far.x + 1), u32(far.y + 1))]);
            }
        }
    }
    return sum;
}

fn diagonal_times(b: u32, s: u32, v: vec2f) -> vec2f {
    let d = diagonal(b, s);
    return vec2f(d.x * v.x + d.y * v.y, d.y * v.x + d.z * v.y);
}

fn place_of_slot(s: u32) -> u32 {
    let n = node_at(s);
    return place(n.x + 1u, n.y + 1u);
}

/// Loads the vector in planes `plane` at the nodes of block b and its halo; 0 at nodes of inactive blocks.
fn load_window(b: u32, t: u32, plane: u32) {
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].active_neighbours[source.x];
        window_z[k] = vec2f();
        if holder != NONE {
            window_z[k] = vector(holder, plane, source.y);
        }
    }
    workgroupBarrier();
}

/// Loads the vector in planes `plane` as the right-hand side of block b.
fn load_right(b: u32, t: u32, plane: u32) {
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        right[s] = vector(b, plane, s);
    }
}

/// Sets the right-hand side of block b to A z, where the window holds z; returns this thread's part of z . A z.
fn multiply(b: u32, t: u32) -> f32 {
    var sum = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        let z = window_z[place_of_slot(s)];
        right[s] = off_diagonal(b, vec2i(node_at(s)), false) + diagonal_times(b, s, z);
        sum += dot(z, right[s]);
    }
    return sum;
}

/// Gauss-Seidel sweeps of z towards A z = r over the node colours of block b. The window holds z; its halo stays
/// frozen. With `inside`, z is taken to be 0 outside the block.
fn sweep_block(b: u32, t: u32, backwards: bool, inside: bool) {
    for (var sweep = 0u; sweep < 4u * params.sweeps; sweep++) {
        let s = thread_slot(select(sweep & 3u, 3u - (sweep & 3u), backwards), t);
        let d = diagonal(b, s);
        let rest = right[s] - off_diagonal(b, vec2i(node_at(s)), inside);
        // A fixed node has r = 0 and no pairs, so it stays at 0.
        window_z[place_of_slot(s)] =
            vec2f(d.z * rest.x - d.y * rest.y, d.x * rest.y - d.y * rest.x) / (d.x * d.z - d.y * d.y);
        workgroupBarrier();
    }
}

/// Smooths z of block b from 0, with 0 around it, and stores it.
fn smooth_from_zero(b: u32, t: u32) {
    for (var k = t; k < WINDOW; k += 64u) {
        window_z[k] = vec2f();
    }
    workgroupBarrier();
    sweep_block(b, t, false, true);
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        set_vector(b, SMOOTHED, s, window_z[place_of_slot(s)]);
    }
}

/// The weights ω of the lower neighbours (method §7.5) at the nodes from (-2, -1) to (16, 16), in rows of 19.
var<workgroup> weights: array<f32, 342>;

fn load_weights(b: u32, t: u32) {
    for (var k = t; k < 342u; k += 64u) {
        let shifted = vec2u(vec2i(i32(k % 19u) - 2, i32(k / 19u) - 1) + 16);
        let holder = blocks[b].active_neighbours[shifted.y / 16u * 3u + shifted.x / 16u];
        weights[k] = 0.0;
        if holder != NONE {
            weights[k] = interpolation_weight_at(holder, slot(shifted.x % 16u, shifted.y % 16u));
        }
    }
    workgroupBarrier();
}

fn weight_at(n: vec2i) -> f32 {
    return weights[u32((n.y + 1) * 19 + n.x + 2)];
}
