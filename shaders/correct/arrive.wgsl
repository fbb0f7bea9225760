// correct: the coarser level's right-hand side, summed from the contributions of the finer level's blocks
// (restrict.wgsl). The kernel that includes this file declares `contributed` and the function `stored_neighbour`.

/// The sum of the contributions to node n of block b.
fn arrived(b: u32, n: vec2i) -> vec2f {
    let quarter = n / 8;
    let local = n % 8;
    var sum = vec2f();
    for (var k = 0u; k < 9u; k++) {
        // The finer blocks next to the node's own block contribute to the outermost nodes of its quarter.
        let side = vec2i(i32(k % 3u), i32(k / 3u)) - 1;
        let reaches = (side == vec2i(0)) | ((side < vec2i(0)) & (local == vec2i(0))) | ((side > vec2i(0)) & (local == vec2i(7)));
        if all(reaches) {
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
