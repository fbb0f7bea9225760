//! The parts of vrtm's compute shaders, in WGSL. `crates/gpu/src/kernels.rs` puts kernels together from them.

macro_rules! texts {
    ($($folder:literal [$($part:literal)*])*) => {
        const TEXTS: &[(&str, &str)] =
            &[$($((concat!($folder, $part), include_str!(concat!($folder, $part, ".wgsl")))),*),*];
    };
}

texts! {
    "" [
        "certify" "common" "energy" "invert" "near_beyond" "near_in_patch" "partial_sum" "patch" "prolong" "pull"
        "pyramid_gather" "pyramid_restrict" "redirect" "relax" "relax_narrow" "relax_wide" "shared_energy" "slopes"
        "surface" "terms"
    ]
    "correct/" [
        "arrive" "assemble" "block_smoother" "conjugate_gradients" "control" "falloff" "first_fractions" "galerkin"
        "gate" "multigrid" "multigrid_coarsest" "multigrid_down" "multigrid_up" "node_row" "pull" "restrict" "shrink"
        "slopes_anew" "slopes_kept" "step" "step_length" "step_limit" "step_vector"
    ]
    "harm/" [
        "features" "multiply" "squares" "weigh"
    ]
    "pbd/" [
        "copy" "moves" "project" "regularise" "state"
    ]
    "sampling/" [
        "chords" "metrics" "resample" "samples" "triangle"
    ]
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
