//! The parts of vrtm's compute shaders, in WGSL. `crates/gpu/src/kernels.rs` puts kernels together from them.

macro_rules! texts {
    ($($part:literal)*) => {
        const TEXTS: &[(&str, &str)] = &[$(($part, include_str!(concat!($part, ".wgsl")))),*];
    };
}

texts! {
    "certify"
    "common"
    "correct/arrive"
    "correct/assemble"
    "correct/block_smoother"
    "correct/conjugate_gradients"
    "correct/control"
    "correct/falloff"
    "correct/first_fractions"
    "correct/galerkin"
    "correct/gate"
    "correct/multigrid"
    "correct/multigrid_coarsest"
    "correct/multigrid_down"
    "correct/multigrid_up"
    "correct/node_row"
    "correct/pull"
    "correct/restrict"
    "correct/shrink"
    "correct/slopes_anew"
    "correct/slopes_kept"
    "correct/step"
    "correct/step_length"
    "correct/step_limit"
    "correct/step_vector"
    "energy"
    "generated"
    "harm/features"
    "harm/multiply"
    "harm/squares"
    "harm/weigh"
    "invert"
    "near_beyond"
    "near_in_patch"
    "partial_sum"
    "patch"
    "pbd/copy"
    "pbd/moves"
    "pbd/project"
    "pbd/regularise"
    "pbd/state"
    "prolong"
    "pull"
    "pyramid_gather"
    "pyramid_restrict"
    "redirect"
    "relax"
    "relax_narrow"
    "relax_wide"
    "sampling/chords"
    "sampling/metrics"
    "sampling/resample"
    "sampling/samples"
    "sampling/triangle"
    "shared_energy"
    "slopes"
    "surface"
    "terms"
}

/// The text of `PART.wgsl`.
///
/// # Panics
///
/// If no part has this name; in a constant that is an error of the compiler.
pub const fn text(part: &str) -> &'static str {
    let mut k = 0;
    while k < TEXTS.len() {
        if equal(TEXTS[k].0.as_bytes(), part.as_bytes()) {
            return TEXTS[k].1;
        }
        k += 1;
    }
    panic!("no part has this name")
}

const fn equal(a: &[u8], b: &[u8]) -> bool {
    let mut k = 0;
    while k < a.len() && k < b.len() && a[k] == b[k] {
        k += 1;
    }
    k == a.len() && k == b.len()
}
