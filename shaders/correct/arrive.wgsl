// correct: the coarser level's right-hand side, summed from the contributions of the finer level's blocks
// (restrict.wgsl). The kernel that includes this file declares `contributed` and the function `stored_neighbour`.

/// The sum of the contributions to node n of block b.
fn arrived(b: u32, n: vec2i) -> vec2f {
    let quarter = n / 8;
    let local = n % 8;
    var sum = vec2f();
    // The finer blocks next to the node's own block contribute to the outermost nodes of its quarter.
    let low = select(vec2i(0), vec2i(-1), local == vec2i(0));
    let high = select(vec2i(0), vec2i(1), local == vec2i(7));
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            let side = vec2i(x, y);
            let at = quarter + side + 2;
            let block = at / 2;
            let holder = stored_neighbour(b, u32(block.y * 3 + block.x));
            if holder != NONE {
                let c = vec2u(local + 1 - 8 * side);
                let child = u32((at.y & 1) * 2 + (at.x & 1));
                sum += contributed[(holder * 4u + child) * 100u + c.y * 10u + c.x];
            }
        }
    }
    return sum;
}
