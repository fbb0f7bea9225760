// correct: the row of the linear system at one node. A thread keeps the rows of its nodes in registers while sweeps and
// products use them again. The kernel that includes this file declares `active_neighbour`.

/// A node's row: its diagonal block (xx, xy, yy), and its encoded pairs with neighbours 0 to 7, two pairs in each vector. A
/// pair is 0 if the node has no such neighbour.
struct NodeRow {
    diagonal: vec3f,
    pairs_01: vec4u,
    pairs_23: vec4u,
    pairs_45: vec4u,
    pairs_67: vec4u,
}

/// The encoded pair of node n of block b, from (-1, -1) to (16, 16), with its neighbour k.
fn pair_words(b: u32, n: vec2i, k: u32) -> vec2u {
    let source = window_source(vec2u(select(n, n + offset(k), k > 3u) + 1));
    let owner = active_neighbour(b, source.x);
    if owner == NONE {
        return vec2u();
    }
    let at = row_index(owner, PAIR + 2u * (k & 3u), source.y);
    return vec2u(rows[at], rows[at + NODES]);
}

fn load_row(b: u32, s: u32) -> NodeRow {
    let n = vec2i(node_at(s));
    let at = row_index(b, 0u, s);
    return NodeRow(
        bitcast<vec3f>(vec3u(rows[at], rows[at + NODES], rows[at + 2u * NODES])),
        vec4u(pair_words(b, n, 0u), pair_words(b, n, 1u)),
        vec4u(pair_words(b, n, 2u), pair_words(b, n, 3u)),
        vec4u(pair_words(b, n, 4u), pair_words(b, n, 5u)),
        vec4u(pair_words(b, n, 6u), pair_words(b, n, 7u)),
    );
}

/// A_pn v for neighbour k of a node.
fn pair_times(words: vec2u, k: u32, v: vec2f) -> vec2f {
    let a = decode(words);
    let across = select(a.yz, a.zy, k > 3u);
    return vec2f(a.x * v.x + across.x * v.y, across.y * v.x + a.w * v.y);
}

fn diagonal_times(row: NodeRow, v: vec2f) -> vec2f {
    let d = row.diagonal;
    return vec2f(d.x * v.x + d.y * v.y, d.y * v.x + d.z * v.y);
}

/// The solution of the diagonal block's system. A fixed node has a right-hand side of 0 and no pairs, so it stays at 0.
fn solve_diagonal(row: NodeRow, rest: vec2f) -> vec2f {
    let d = row.diagonal;
    return vec2f(d.z * rest.x - d.y * rest.y, d.x * rest.y - d.y * rest.x) / (d.x * d.z - d.y * d.y);
}

/// The sum of A_pn v_n over the neighbours of node n (0 to 15), where the window that begins at `window` holds v.
fn row_times(row: NodeRow, n: vec2u, window: u32) -> vec2f {
    var sum = pair_times(row.pairs_01.xy, 0u, window_z[window + place(n.x + 2u, n.y + 1u)]);
    sum += pair_times(row.pairs_01.zw, 1u, window_z[window + place(n.x + 1u, n.y + 2u)]);
    sum += pair_times(row.pairs_23.xy, 2u, window_z[window + place(n.x + 2u, n.y + 2u)]);
    sum += pair_times(row.pairs_23.zw, 3u, window_z[window + place(n.x, n.y + 2u)]);
    sum += pair_times(row.pairs_45.xy, 4u, window_z[window + place(n.x, n.y + 1u)]);
    sum += pair_times(row.pairs_45.zw, 5u, window_z[window + place(n.x + 1u, n.y)]);
    sum += pair_times(row.pairs_67.xy, 6u, window_z[window + place(n.x, n.y)]);
    return sum + pair_times(row.pairs_67.zw, 7u, window_z[window + place(n.x + 2u, n.y)]);
}
