// For relax.wgsl: four threads per node, each with one quarter of its terms; they exchange what they find through
// workgroup memory. It takes half of the time where there are few blocks, and more work in all.

const PATCH_THREADS: u32 = 256u;

/// Per thread: gradient, and xx and xy of the matrix.
var<workgroup> parts: array<vec4f, 256>;
/// Per thread: yy of the matrix; then what its corners leave of a step.
var<workgroup> numbers: array<f32, 256>;

fn terms_of_thread(n: vec2u, p: NodeState, slopes: mat2x3f, floor: f32, t: u32) -> Local {
    return quarter(n, p, slopes, floor, t / 64u);
}

fn sum_of_terms(l: Local, t: u32) -> Local {
    parts[t] = vec4f(l.gradient, l.matrix.xy);
    numbers[t] = l.matrix.z;
    workgroupBarrier();
    let k = t % 64u;
    let sum = (parts[k] + parts[k + 64u]) + (parts[k + 128u] + parts[k + 192u]);
    let yy = (numbers[k] + numbers[k + 64u]) + (numbers[k + 128u] + numbers[k + 192u]);
    return Local(sum.xy, vec3f(sum.zw, yy));
}

fn bound_of_thread(n: vec2u, u: vec2f, delta: vec2f, t: u32) -> f32 {
    return quarter_bound(n, u, delta, t / 64u);
}

fn least_bound(bound: f32, t: u32) -> f32 {
    workgroupBarrier();
    numbers[t] = bound;
    workgroupBarrier();
    let k = t % 64u;
    return min(min(numbers[k], numbers[k + 64u]), min(numbers[k + 128u], numbers[k + 192u]));
}
