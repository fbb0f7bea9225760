//! The targets of fuzz/ with random bytes and with what a fuzzer found: each call returns a known status, none returns
//! VRTM_ERROR_INTERNAL, and failures write nothing.

#[path = "../../fuzz/src/lib.rs"]
mod fuzz;

use std::sync::atomic::Ordering;

use fuzz::{STATUSES, calls, images, mesh, saved};
use vrtm_capi::{device::VRTM_BACKEND_GPU, status::*};
use vrtm_testkit::{gpu, long};

type Target = (&'static str, fn(&[u8]));

const TARGETS: [Target; 4] =
    [("calls", calls::run), ("images", images::run), ("mesh", mesh::run), ("saved", saved::run)];

/// Bytes that are the same on every platform (Steele, Lea and Flood's SplitMix64).
fn random(seed: u64, words: u64) -> Vec<u8> {
    let word = |k: u64| {
        let z = (seed << 32 | k).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    };
    (0..words).flat_map(|k| word(k).to_ne_bytes()).collect()
}

#[test]
fn random_inputs_never_do_harm() {
    for (name, run) in TARGETS {
        let start = std::time::Instant::now();
        for seed in 0..long::cases(300, 100, name) {
            run(&random(seed, 100));
        }
        println!("{name}: {:?}", start.elapsed());
    }
    let statuses = STATUSES.each_ref().map(|count| count.load(Ordering::Relaxed));
    println!("calls by status: {statuses:?}");
    // If nearly all calls failed, or none did, the test would check little.
    let calls = statuses.iter().sum::<usize>();
    assert!(statuses[VRTM_OK as usize] > calls / 4, "{statuses:?}");
    for status in [VRTM_ERROR_INVALID_ARGUMENT, VRTM_ERROR_INVALID_HANDLE, VRTM_ERROR_NOT_SOLVED] {
        assert!(statuses[status as usize] > calls / 300, "{statuses:?}");
    }
}

#[test]
fn what_a_fuzzer_found_does_no_harm() {
    for (name, run) in TARGETS {
        let folder = format!("{}/../fuzz/seeds/{name}", env!("CARGO_MANIFEST_DIR"));
        let mut inputs = 0;
        for file in std::fs::read_dir(folder).unwrap() {
            run(&std::fs::read(file.unwrap().path()).unwrap());
            inputs += 1;
        }
        assert!(inputs > 10, "{name}: {inputs}");
    }
}

#[test]
fn random_calls_to_a_gpu_never_do_harm() {
    if gpu::has_gpu() {
        for seed in 0..long::cases(40, 10, "calls on a GPU") {
            calls::run_on(VRTM_BACKEND_GPU, &random(seed, 100));
        }
    }
}
