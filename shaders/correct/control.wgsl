// What is decided chart by chart: sums over blocks, conjugate gradients' scalars, whether a correction counts. One
// workgroup per chart; nothing is read back.

/// Per level and chart: the range of its blocks in `partials`.
@group(0) @binding(10) var<storage, read> ranges: array<vec2u>;

var<workgroup> totals: array<vec4f, 64>;

/// Sums a chart's partials: of y the smallest, of w the largest.
fn total(c: u32, t: u32) -> vec4f {
    let range = ranges[params.level * params.items + c];
    var sum = vec4f(0.0, WORTHLESS, 0.0, 0.0);
    for (var k = t; k < range.y; k += 64u) {
        sum = add(sum, partials[range.x + k]);
    }
    totals[t] = sum;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if t < half {
            totals[t] = add(totals[t], totals[t + half]);
        }
        workgroupBarrier();
    }
    return totals[0];
}

fn add(a: vec4f, b: vec4f) -> vec4f {
    return vec4f(a.x + b.x, min(a.y, b.y), a.z + b.z, max(a.w, b.w));
}

/// What the total is for.
const IDENTITY: u32 = 0u;
const BEFORE: u32 = 1u;
const DIRECTION: u32 = 2u;
const FIRST_DIRECTION: u32 = 3u;
const LENGTH_OF_STEP: u32 = 4u;
const TRIAL: u32 = 5u;
const LAST_TRIAL: u32 = 6u;
const ENERGY: u32 = 7u;
const CERTIFICATE: u32 = 8u;
/// A certificate that decides nothing: any result that is a number counts.
const AS_IT_IS: u32 = 9u;

@compute @workgroup_size(64)
fn decide(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let c = group.y * SPREAD + group.x;
    if c >= params.items {
        return;
    }
    let sum = total(c, t);
    if t > 0u || charts[c].working == 0u {
        return;
    }
    switch params.mode {
        case IDENTITY: {
            charts[c].identity = sum.x;
        }
        case BEFORE: {
            charts[c].before = sum.x;
        }
        case DIRECTION, FIRST_DIRECTION: {
            // In steps, of which the last one was alpha directions.
            let beta = sum.x / charts[c].rz / charts[c].alpha;
            charts[c].beta = select(0.0, beta, params.mode == DIRECTION && is_number(beta));
            charts[c].rz = sum.x;
        }
        case LENGTH_OF_STEP: {
            let alpha = charts[c].rz / select(1.0, sum.x, sum.x > 0.0);
            // Nothing left to solve, or not a number: no step.
            charts[c].alpha = select(0.0, alpha, sum.x > 0.0 && is_number(alpha));
            charts[c].predicted += charts[c].alpha * charts[c].rz;
        }
        case TRIAL, LAST_TRIAL: {
            let before = charts[c].before;
            // The last trial is relaxation alone.
            let enough = SUFFICIENT * charts[c].next * charts[c].predicted;
            if before - sum.x > enough || params.mode == LAST_TRIAL {
                charts[c].working = 0u;
                let gain = before - sum.x;
                let identity = select(0.0, charts[c].identity, params.level == 0u);
                let unit = params.tolerance * (before + OF_IDENTITY * identity);
                // A first correction that is trusted is enough if it gained what its model had foretold.
                let trusted = charts[c].first == 1u && params.part != 0.0;
                let missed = ramp(abs(gain - charts[c].predicted) / unit, MISSED);
                let most = select(GROWTH * charts[c].next, missed, trusted);
                let next = select(0.0, min(ramp(gain / unit, GAINED), most), gain > 0.0);
                charts[c].next = next;
                charts[c].done = u32(!(next > 0.0));
            }
        }
        case ENERGY: {
            charts[c].energy = sum.x;
        }
        case CERTIFICATE, AS_IT_IS: {
            charts[c].min_jacobian = min(sum.y, 1.0);
            charts[c].folds = u32(sum.z);
            charts[c].max_displacement = sum.w;
            let energy = charts[c].energy;
            let counts = energy < WORTHLESS && is_number(energy);
            let better = energy <= charts[c].identity && sum.z == 0.0;
            charts[c].fallback = u32(!(counts && (better || params.mode == AS_IT_IS)));
        }
        default: {}
    }
}

/// As in src/solve.rs.
const OF_IDENTITY: f32 = 0.06;
const SUFFICIENT: f32 = 0.02;
const GROWTH: f32 = 4.0;
const GAINED = vec2f(1.0, 4.0);
const MISSED = vec2f(0.1, 3.0);

fn ramp(x: f32, ends: vec2f) -> f32 {
    return clamp((x - ends.x) / (ends.y - ends.x), 0.0, 1.0);
}

const ALL: u32 = 0u;
const FIRST_CORRECTION: u32 = 1u;
const LATER_CORRECTION: u32 = 2u;

/// Which charts the next stages work on.
@compute @workgroup_size(64)
fn select_charts(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let c = (group.y * SPREAD + group.x) * 64u + t;
    if c >= params.items {
        return;
    }
    if params.mode == FIRST_CORRECTION {
        charts[c].done = 0u;
        charts[c].next = 1.0;
    }
    if params.mode != ALL {
        charts[c].first = u32(params.mode == FIRST_CORRECTION);
        charts[c].predicted = 0.0;
        atomicStore(&charts[c].cuts, 0u);
    }
    charts[c].working = charts[c].solve & select(1u, 1u - charts[c].done, params.mode != ALL);
}
