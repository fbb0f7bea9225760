// correct: the row of the linear system at one node. A thread keeps the row of its node in registers, decoded, while
// sweeps and products use it again. The kernel that includes this file declares `active_neighbour`.

/// A node's row: its diagonal block (xx, xy, yy), and its pairs with neighbours 0 to 7 (xx, xy, yx, yy). A pair is 0 if
/// the node has no such neighbour.
struct NodeRow {
    diagonal: vec3f,
    pair_0: vec4f,
    pair_1: vec4f,
    pair_2: vec4f,
    pair_3: vec4f,
    pair_4: vec4f,
    pair_5: vec4f,
    pair_6: vec4f,
    pair_7: vec4f,
}

/// The pair of node n of block b, from (-1, -1) to (16, 16), with its neighbour k.
fn load_pair(b: u32, n: vec2i, k: u32) -> vec4f {
    let source = window_source(vec2u(select(n, n + offset(k), k > 3u) + 1));
    let owner = active_neighbour(b, source.x);
    if owner == NONE {
        return vec4f();
    }
    let at = row_index(owner, PAIR + 2u * (k & 3u), source.y);
    let a = decode(vec2u(rows[at], rows[at + NODES]));
    return select(a, a.xzyw, k > 3u);
}

/// The pair of the node at slot s of block b with its neighbour k < 4: the node owns it.
fn own_pair(b: u32, s: u32, k: u32) -> vec4f {
    let at = row_index(b, PAIR + 2u * k, s);
    return decode(vec2u(rows[at], rows[at + NODES]));
}

fn load_row(b: u32, s: u32) -> NodeRow {
    let n = vec2i(node_at(s));
    let at = row_index(b, 0u, s);
    return NodeRow(
        bitcast<vec3f>(vec3u(rows[at], rows[at + NODES], rows[at + 2u * NODES])),
        own_pair(b, s, 0u),
        own_pair(b, s, 1u),
        own_pair(b, s, 2u),
        own_pair(b, s, 3u),
        load_pair(b, n, 4u),
        load_pair(b, n, 5u),
        load_pair(b, n, 6u),
        load_pair(b, n, 7u),
    );
}

fn pair_times(a: vec4f, v: vec2f) -> vec2f {
    return a.xz * v.x + a.yw * v.y;
}

fn diagonal_times(d: vec3f, v: vec2f) -> vec2f {
    return d.xy * v.x + d.yz * v.y;
}

/// The inverse of a diagonal block.
fn inverse_of(d: vec3f) -> vec3f {
    return vec3f(d.z, -d.y, d.x) * (1.0 / (d.x * d.z - d.y * d.y));
}
