// gate: writes the arguments of the indirect dispatches that follow: the workgroups of each list, or 0 unless some
// chart is at work and was limited by at least `mode` dispatches of the step limit. A trial or a round of the step
// limit that no chart needs then costs next to nothing, and nothing is read back for it.

/// Workgroups of each dispatch size: one per chart first, then those for the lists of blocks.
@group(0) @binding(10) var<storage, read> dispatch_sizes: array<u32>;
/// Arguments of indirect dispatches, 16 bytes each.
@group(0) @binding(11) var<storage, read_write> indirect_arguments: array<u32>;
/// Per gate of this solve: 1 if its dispatches run.
@group(0) @binding(12) var<storage, read_write> gate_open: array<u32>;

var<workgroup> working: array<u32, 64>;

@compute @workgroup_size(64)
fn gate(@builtin(local_invocation_index) t: u32) {
    var any = 0u;
    for (var c = t; c < params.items; c += 64u) {
        any |= select(0u, charts[c].working, atomicLoad(&charts[c].limit_rounds) >= params.mode);
    }
    working[t] = any;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if t < half {
            working[t] |= working[t + half];
        }
        workgroupBarrier();
    }
    let open = working[0];
    for (var k = t; k < params.count; k += 64u) {
        let size = dispatch_sizes[k] * open;
        let at = 4u * (params.first + k);
        indirect_arguments[at] = min(size, SPREAD);
        indirect_arguments[at + 1u] = (size + SPREAD - 1u) / SPREAD;
        indirect_arguments[at + 2u] = open;
    }
    if t == 0u {
        gate_open[params.gate] = open;
    }
}
