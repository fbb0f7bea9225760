// correct: the coarsest level of the V-cycle (method §7.4): one workgroup per chart, which has few nodes there, does
// the pass forwards and the pass backwards over the chart's blocks, in one dispatch. It reads 88 bytes of rows, 13 of
// contributions, 4 of constants and 8 of z per node, and writes 24.

/// Contributions of the finer level (restrict.wgsl).
@group(0) @binding(10) var<storage, read> contributed: array<vec2f>;
/// Per level and chart: first and count of the chart's active blocks among those of the level.
@group(0) @binding(11) var<storage, read> ranges: array<vec2u>;

var<workgroup> chart_range: vec2u;

fn stored_neighbour(b: u32, k: u32) -> u32 {
    return blocks[b].neighbours[k];
}

@compute @workgroup_size(256)
fn multigrid_coarsest(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let c = group.y * SPREAD + group.x;
    if c >= params.items {
        return;
    }
    if t == 0u {
        chart_range = select(vec2u(), ranges[params.level * params.items + c], charts[c].working == 1u);
    }
    let range = workgroupUniformLoad(&chart_range);
    for (var k = 0u; k < range.y; k++) {
        let b = lists[params.first + range.x + k];
        let right = select(arrived(b, vec2i(node_at(t))), vec2f(), is_fixed(b, t));
        set_vector(b, RESIDUAL, t, right);
        smooth_from_zero(b, load_row(b, t), right, t);
        workgroupBarrier();
    }
    storageBarrier();
    for (var k = 0u; k < range.y; k++) {
        let b = lists[params.first + range.x + k];
        let row = load_row(b, t);
        load_window(b, t, SMOOTHED);
        sweep_block(row, vector(b, RESIDUAL, t), t, params.sweeps, true);
        set_vector(b, DIRECTION, t, window_z[place_of_slot(t)]);
        workgroupBarrier();
    }
}
