// correct: the falloff of step fractions (method §7.6), along the rows of nodes or along the columns, forth and back
// through all active blocks that lie side by side. A workgroup goes along one row or column of blocks, a thread
// along one line of nodes. Per node it reads 8 bytes and writes 8.

/// The slot of the node at `place` of a line of nodes.
fn line_slot(place: u32, line: u32) -> u32 {
    let along_columns = (params.mode & 1u) != 0u;
    return select(slot(place, line), slot(line, place), along_columns);
}

/// Lowers fractions until those of neighbouring nodes differ by at most the chart's slope. `mode` is twice the number
/// of the round that comes before, 0 if none does, plus 1 along the columns.
@compute @workgroup_size(16)
fn falloff(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let round = params.mode / 2u;
    let before = select(3u, 1u, (params.mode & 1u) != 0u);
    let after = 8u - before;
    var b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    let c = blocks[b].chart;
    // The first block of each line works on all of it.
    if atomicLoad(&charts[c].limit_rounds) <= round || blocks[b].active_neighbours[before] != NONE {
        return;
    }
    let longest = bitcast<f32>(atomicLoad(&charts[c].longest));
    let slope = min(FRACTION_FALLOFF, STEP_FALLOFF / max(longest, STEP_FALLOFF));
    let plane = FRACTION + (round & 1u);
    var low = 1.0;
    loop {
        for (var place = 0u; place < 16u; place++) {
            let at = vector_index(b, plane, line_slot(place, t));
            low = min(vectors[at], low + slope);
            vectors[at] = low;
        }
        let next = blocks[b].active_neighbours[after];
        if next == NONE {
            break;
        }
        b = next;
    }
    low = 1.0;
    loop {
        for (var place = 16u; place > 0u; place--) {
            let at = vector_index(b, plane, line_slot(place - 1u, t));
            low = min(vectors[at], low + slope);
            vectors[at] = low;
        }
        b = blocks[b].active_neighbours[before];
        if b == NONE {
            break;
        }
    }
}
