// Sums over the threads of a workgroup, which `decide` (correct/control.wgsl) adds up chart by chart.

var<workgroup> sums: array<f32, 256>;

/// Writes the sum of all threads' values as quantity `quantity` of this block's partial sums.
fn write_sum(group: vec3u, t: u32, quantity: u32, value: f32) {
    sums[t] = value;
    workgroupBarrier();
    for (var half = 128u; half > 0u; half /= 2u) {
        if t < half {
            sums[t] += sums[t + half];
        }
        workgroupBarrier();
    }
    if t == 0u {
        partials[sum_index(quantity, group.y * SPREAD + group.x)] = sums[0];
    }
}
