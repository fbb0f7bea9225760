// correct: the preconditioner's smoother, products with the system, and the way between levels. All of it works on the
// stored rows: per node a sweep reads 76 bytes of them (a quarter more at the rim) and 16 of vectors, and writes 8.

var<workgroup> near: array<vec2f, 324>;

/// Loads plane pair `plane` of the vectors around block b; only blocks of the `written` colours (a bit each) count.
fn load_vector(b: u32, t: u32, plane: u32, written: u32) {
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].links[source.x];
        near[k] = vec2f();
        if holder != NONE && ((written >> block_colour(holder)) & 1u) != 0u {
            let at = vector_at(holder, plane, source.y);
            near[k] = vec2f(vectors[at], vectors[at + NODES]);
        }
    }
    workgroupBarrier();
}

fn block_colour(b: u32) -> u32 {
    return (blocks[b].y & 1u) * 2u + (blocks[b].x & 1u);
}

/// The sum over neighbours of A_pn v_n, from the window.
fn off_diagonal(b: u32, n: vec2u) -> vec2f {
    var sum = vec2f();
    for (var k = 0u; k < 8u; k++) {
        let far = vec2u(vec2i(n) + 1 + offset(k));
        let theirs = k > 3u;
        let source = window_source(select(n + 1u, far, theirs));
        let owner = blocks[b].links[source.x];
        if owner != NONE {
            let at = row_at(owner, PAIR + 4u * (k & 3u), source.y);
            let xy = rows[at + NODES];
            let yx = rows[at + 2u * NODES];
            let v = near[place(far.x, far.y)];
            sum += vec2f(
                rows[at] * v.x + select(xy, yx, theirs) * v.y,
                select(yx, xy, theirs) * v.x + rows[at + 3u * NODES] * v.y
            );
        }
    }
    return sum;
}

fn diagonal(b: u32, s: u32) -> vec3f {
    let at = row_at(b, 0u, s);
    return vec3f(rows[at], rows[at + NODES], rows[at + 2u * NODES]);
}

fn vector(b: u32, plane: u32, s: u32) -> vec2f {
    let at = vector_at(b, plane, s);
    return vec2f(vectors[at], vectors[at + NODES]);
}

fn set_vector(b: u32, plane: u32, s: u32, v: vec2f) {
    let at = vector_at(b, plane, s);
    vectors[at] = v.x;
    vectors[at + NODES] = v.y;
}

const BACKWARDS: u32 = 1u;
/// z is zero before this pass over the block colours.
const FRESH: u32 = 2u;

/// Sweeps of z towards A z = r inside a block, its ring frozen. One dispatch is one block colour.
@compute @workgroup_size(64)
fn smooth_z(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    // In a fresh pass only the colours before this one hold anything.
    let colour = block_colour(b);
    let written = select(15u, (1u << colour) - 1u, (params.mode & FRESH) != 0u);
    load_vector(b, t, Z, written);
    let backwards = (params.mode & BACKWARDS) != 0u;
    for (var sweep = 0u; sweep < 4u * params.sweeps; sweep++) {
        let k = select(sweep & 3u, 3u - (sweep & 3u), backwards);
        let s = own_slot(k, t);
        let n = node_of(s);
        let d = diagonal(b, s);
        let rest = vector(b, R, s) - off_diagonal(b, n);
        // A fixed node has r = 0 and no pairs: it stays at 0.
        near[place(n.x + 1u, n.y + 1u)] =
            vec2f(d.z * rest.x - d.y * rest.y, d.x * rest.y - d.y * rest.x) / (d.x * d.z - d.y * d.y);
        workgroupBarrier();
    }
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        let n = node_of(s);
        set_vector(b, Z, s, near[place(n.x + 1u, n.y + 1u)]);
    }
}

/// A v at a node, v being in the window.
fn product(b: u32, s: u32) -> vec2f {
    let n = node_of(s);
    let d = diagonal(b, s);
    let v = near[place(n.x + 1u, n.y + 1u)];
    return off_diagonal(b, n) + vec2f(d.x * v.x + d.y * v.y, d.y * v.x + d.z * v.y);
}

/// t = r - A z.
@compute @workgroup_size(64)
fn residual(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    load_vector(b, t, Z, 15u);
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        set_vector(b, T, s, vector(b, R, s) - product(b, s));
    }
}
