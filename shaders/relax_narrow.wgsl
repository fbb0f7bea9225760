// For relax.wgsl: one thread per node. It takes the least work in all, for levels that fill a GPU. Sums
// have the order of relax_wide.wgsl.

const PATCH_THREADS: u32 = 64u;

fn terms_of_thread(n: vec2u, p: NodeState, slopes: mat2x3f, floor: f32, t: u32) -> Local {
    return plus(
        plus(quarter(n, p, slopes, floor, 0u), quarter(n, p, slopes, floor, 1u)),
        plus(quarter(n, p, slopes, floor, 2u), quarter(n, p, slopes, floor, 3u))
    );
}

fn plus(a: Local, b: Local) -> Local {
    return Local(a.gradient + b.gradient, a.matrix + b.matrix);
}

fn sum_of_terms(l: Local, t: u32) -> Local {
    return l;
}

fn bound_of_thread(n: vec2u, u: vec2f, delta: vec2f, t: u32) -> f32 {
    return min(
        min(quarter_bound(n, u, delta, 0u), quarter_bound(n, u, delta, 1u)),
        min(quarter_bound(n, u, delta, 2u), quarter_bound(n, u, delta, 3u))
    );
}

fn least_bound(bound: f32, t: u32) -> f32 {
    return bound;
}
