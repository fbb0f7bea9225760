// Whether what follows has anything to do: sizes of indirect dispatches, 0 if no chart is at work. Written where charts
// were chosen, so that a correction that no chart needs costs next to nothing.

/// Workgroups of each list of blocks.
@group(0) @binding(10) var<storage, read> sizes: array<u32>;
/// Arguments of dispatches, 16 bytes each.
@group(0) @binding(11) var<storage, read_write> gates: array<u32>;
/// Per gate of this solve: 1 if it let its dispatches through.
@group(0) @binding(12) var<storage, read_write> opened: array<u32>;

var<workgroup> open: array<u32, 64>;

@compute @workgroup_size(64)
fn gate(@builtin(local_invocation_index) t: u32) {
    var any = 0u;
    for (var c = t; c < params.items; c += 64u) {
        let counts = (params.mode & GATE_LIMITED) == 0u || atomicLoad(&charts[c].limit_rounds) > 0u;
        any |= select(0u, charts[c].working, counts);
    }
    open[t] = any;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if t < half {
            open[t] |= open[t + half];
        }
        workgroupBarrier();
    }
    let yes = open[0];
    for (var k = t; k < params.count; k += 64u) {
        let size = sizes[k] * yes;
        let at = 4u * (params.first + k);
        gates[at] = min(size, SPREAD);
        gates[at + 1u] = (size + SPREAD - 1u) / SPREAD;
        gates[at + 2u] = yes;
    }
    if t == 0u {
        opened[params.partial] = yes;
    }
}
