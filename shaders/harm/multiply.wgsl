// harm: multipliers of the features that are worse than without a warp (method §4, Harm). One workgroup works on each
// feature: the counterpart of `growth` and `multiplier` in crates/core/src/method/law.rs.

@group(0) @binding(11) var<storage, read> squares: array<f32>;
@group(0) @binding(12) var<storage, read_write> multipliers: array<f32>;

var<workgroup> sums: array<vec2f, 256>;

@compute @workgroup_size(256)
fn multiply(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let feature = group.y * SPREAD + group.x;
    if feature >= features[2] {
        return;
    }
    let pieces = features[1];
    let firsts = first_name() + pieces;
    let list = firsts + features[2] + 1u;
    let end = features[firsts + feature + 1u];
    var sum = vec2f();
    for (var k = features[firsts + feature] + t; k < end; k += 256u) {
        let piece = features[list + k];
        sum += vec2f(squares[piece], squares[pieces + piece]);
    }
    sums[t] = sum;
    workgroupBarrier();
    for (var half = 128u; half > 0u; half /= 2u) {
        if t < half {
            sums[t] += sums[t + half];
        }
        workgroupBarrier();
    }
    if t == 0u {
        let edges = features[list + pieces + feature];
        let mean = sums[0] / f32(max(edges, 1u));
        let now = sqrt(mean.y);
        let harm = now - sqrt(mean.x + HARM_MARGIN * HARM_MARGIN);
        let growth = select(0.0, harm / now * (harm / (harm + HARM_ONSET)), harm > 0.0 && edges >= LEAST_EDGES);
        let grown = min(multipliers[feature] * params.kept + params.factor * growth, MOST_MULTIPLIER);
        multipliers[feature] = floor(grown * MULTIPLIER_STEPS + 0.5) / MULTIPLIER_STEPS;
    }
}
