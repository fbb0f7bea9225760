// correct and certify: decisions chart by chart, from sums over blocks: the scalars of conjugate gradients (method
// §7.3), the acceptance of a trial and the next step fraction (method §7.7), and the fallback (method §8). One
// workgroup works on each chart, and nothing is read back.

/// Per level and chart: first and count of its blocks' entries in `partials`.
@group(0) @binding(10) var<storage, read> ranges: array<vec2u>;

var<workgroup> totals: array<vec4f, 256>;

/// Combines four quantities of the partial sums of chart c, from `first` on: all are summed or, for a certificate, x
/// and z are summed, y is the minimum and w the maximum.
fn total(c: u32, t: u32, first: u32, certificate: bool) -> vec4f {
    let range = ranges[params.level * params.items + c];
    let none = select(vec4f(), vec4f(0.0, INVALID_ENERGY, 0.0, 0.0), certificate);
    var sum = none;
    for (var k = t; k < range.y; k += 256u) {
        let at = range.x + k;
        let part = vec4f(
            partials[sum_index(first, at)], partials[sum_index(first + 1u, at)], partials[sum_index(first + 2u, at)],
            partials[sum_index(first + 3u, at)]
        );
        sum = add(sum, part, certificate);
    }
    totals[t] = sum;
    workgroupBarrier();
    for (var half = 128u; half > 0u; half /= 2u) {
        if t < half {
            totals[t] = add(totals[t], totals[t + half], certificate);
        }
        workgroupBarrier();
    }
    return totals[0];
}

fn add(a: vec4f, b: vec4f, certificate: bool) -> vec4f {
    return select(a + b, vec4f(a.x + b.x, min(a.y, b.y), a.z + b.z, max(a.w, b.w)), certificate);
}

/// 0 up to `ends.x`, 1 from `ends.y` on, linear in between.
fn ramp(x: f32, ends: vec2f) -> f32 {
    return clamp((x - ends.x) / (ends.y - ends.x), 0.0, 1.0);
}

/// A chart's energies before and after a correction, and the values with which acceptance compares them. This struct
/// and the two functions below are the counterparts of `Gain` in crates/core/src/method/acceptance.rs.
struct Gain {
    before: f32,
    after: f32,
    identity: f32,
    predicted: f32,
    cut: f32,
    fraction: f32,
}

/// True if a trial satisfies the condition of sufficient decrease (method §7.7, item 4).
fn suffices(gain: Gain) -> bool {
    return gain.before - gain.after > SUFFICIENT_DECREASE * gain.fraction * gain.predicted;
}

/// Step fraction of the chart's next correction (method §7.7); 0 if the chart takes no part in the level's further
/// corrections.
fn next_fraction(gain: Gain, tolerance: f32, trusted: bool) -> f32 {
    let unit = tolerance * (gain.before + IDENTITY_ENERGY_WEIGHT * gain.identity);
    let gained = gain.before - gain.after;
    let error = max(abs(gained - gain.predicted), gain.cut * gain.predicted);
    let model_error = ramp(error / unit, MODEL_ERROR_RAMP);
    let most = select(FRACTION_GROWTH * gain.fraction, model_error, trusted);
    return select(0.0, min(ramp(gained / unit, GAIN_RAMP), most), gained > 0.0);
}

/// After the first V-cycle: the first step with the gain that it predicts, and the energy before the correction.
fn first_step(c: u32, sum: vec4f) {
    charts[c].before = sum.x;
    charts[c].rz = sum.y;
    charts[c].curvature = sum.z;
    let alpha = step_length(sum.y, sum.z);
    charts[c].alpha = alpha;
    charts[c].step = array<f32, 3>(alpha, 0.0, 0.0);
    charts[c].predicted = alpha * sum.y;
}

/// After the second V-cycle: the step as a combination of z0, z1 and the last step, and the predicted gain. The second
/// direction is z1 + beta z0; its curvature is that of z1 plus the terms with z0. `last` are the products of the last
/// step.
fn second_step(c: u32, sum: vec4f, last: vec4f) {
    let alpha = charts[c].alpha;
    let quotient = sum.x / charts[c].rz;
    let beta = select(0.0, quotient, alpha != 0.0 && is_finite(quotient));
    let curvature = sum.z + beta * (2.0 * sum.y + beta * charts[c].curvature);
    let second = step_length(sum.x, curvature);
    let lengths = vec2f(alpha, second);
    var step = Combination(vec3f(lengths, 0.0), alpha * charts[c].rz + second * sum.x);
    if params.has_last_step == 1u {
        let products = vec4f(last.x, last.y, last.z + beta * last.y, last.w);
        step = with_last_step(lengths, vec2f(charts[c].curvature, curvature), step.predicted, products);
    }
    let factors = step.factors;
    charts[c].step = array<f32, 3>(factors.x + factors.y * beta, factors.y, factors.z);
    charts[c].predicted = step.predicted;
}

@compute @workgroup_size(256)
fn decide(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let c = group.y * SPREAD + group.x;
    if c >= params.items {
        return;
    }
    let is_certificate = params.mode == DECIDE_CERTIFICATE || params.mode == DECIDE_ALLOWING_FOLDS;
    let sum = total(c, t, select(0u, SUM_RZ_SECOND, params.mode == DECIDE_SECOND_STEP), is_certificate);
    var last: vec4f;
    if params.has_last_step == 1u && params.mode == DECIDE_SECOND_STEP {
        workgroupBarrier();
        last = total(c, t, SUM_LAST_RESIDUAL, false);
    }
    if t > 0u || !is_at_work(c) {
        return;
    }
    switch params.mode {
        case DECIDE_IDENTITY: {
            charts[c].identity = sum.x;
        }
        case DECIDE_FIRST_STEP: {
            first_step(c, sum);
        }
        case DECIDE_SECOND_STEP: {
            second_step(c, sum, last);
        }
        case DECIDE_TRIAL, DECIDE_LAST_TRIAL: {
            let identity = select(0.0, charts[c].identity, params.level == 0u);
            let cut = bitcast<f32>(atomicLoad(&charts[c].cut));
            let gain = Gain(charts[c].before, sum.x, identity, charts[c].predicted, cut, charts[c].fraction);
            // The last trial is relaxation alone, which is always accepted.
            if suffices(gain) || params.mode == DECIDE_LAST_TRIAL {
                charts[c].energy = sum.x;
                charts[c].working = 0u;
                let trusted = charts[c].first == 1u && params.trusts_model == 1u;
                let fraction = next_fraction(gain, params.tolerance, trusted);
                charts[c].fraction = fraction;
                charts[c].finished = u32(!(fraction > 0.0));
            }
        }
        case DECIDE_ENERGY: {
            charts[c].energy = sum.x;
        }
        case DECIDE_CERTIFICATE, DECIDE_ALLOWING_FOLDS: {
            charts[c].min_jacobian = min(sum.y, 1.0);
            charts[c].folds = u32(sum.z);
            charts[c].max_displacement = sum.w;
            let energy = charts[c].energy;
            let valid = energy < INVALID_ENERGY && is_finite(energy);
            let better = energy <= charts[c].identity && sum.z == 0.0;
            charts[c].fallback = u32(!(valid && (better || params.mode == DECIDE_ALLOWING_FOLDS)));
        }
        default: {}
    }
}

/// Selects the charts that take part in a correction (`working`), by `mode`, which is one of SELECT_.
@compute @workgroup_size(64)
fn select_charts(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let c = (group.y * SPREAD + group.x) * 64u + t;
    if c >= params.items {
        return;
    }
    if params.mode == SELECT_FIRST_CORRECTION {
        charts[c].finished = 0u;
        charts[c].fraction = 1.0;
    }
    charts[c].first = u32(params.mode == SELECT_FIRST_CORRECTION);
    charts[c].predicted = 0.0;
    atomicStore(&charts[c].limit_rounds, 0u);
    atomicStore(&charts[c].longest, 0u);
    atomicStore(&charts[c].cut, 0u);
    charts[c].working = charts[c].solved & (1u - charts[c].finished);
}
