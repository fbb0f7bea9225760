//! The machine on which times are measured, and its limits: the bandwidth and the rate of operations that no program of
//! this kind can exceed there.

use std::hint::black_box;
use std::time::Instant;

pub struct Machine {
    pub cpu: String,
    pub threads: usize,
    /// The widest vector instructions that the processor has.
    pub simd: &'static str,
    pub compiler: String,
    pub adapters: Vec<String>,
    pub copy_gb_per_s: f64,
    pub peak_gflops: f64,
}

impl Machine {
    pub fn look() -> Machine {
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
        let name = vrtm_testkit::bench::processor().unwrap_or("processor of unknown name".into());
        let adapters = vrtm::adapters().into_iter();
        let rustc = std::process::Command::new("rustc").arg("--version").output().ok();
        let rustc = rustc.and_then(|output| String::from_utf8(output.stdout).ok());
        Machine {
            cpu: format!("{} ({})", name, std::env::consts::ARCH),
            threads,
            simd: simd(),
            compiler: rustc.map_or("rustc of unknown version".into(), |text| text.trim().into()),
            adapters: adapters
                .map(|a| if a.software { format!("{} (software)", a.name) } else { a.name })
                .collect(),
            copy_gb_per_s: copy(threads),
            peak_gflops: peak(threads),
        }
    }

    pub fn text(&self) -> String {
        let adapters = if self.adapters.is_empty() { "none".into() } else { self.adapters.join(", ") };
        format!(
            "{}, {} threads, {}; {}; GPU adapters: {adapters}. Floors, all threads: copies of large buffers {:.1} GB/s \
             (bytes read and written), f32 multiply and add in registers, not fused, {:.0} GFLOP/s.",
            self.cpu, self.threads, self.simd, self.compiler, self.copy_gb_per_s, self.peak_gflops
        )
    }
}

fn simd() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        match () {
            () if is_x86_feature_detected!("avx512f") => "AVX-512",
            () if is_x86_feature_detected!("avx2") => "AVX2",
            () => "SSE2",
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        if cfg!(target_arch = "aarch64") { "NEON" } else { "unknown vectors" }
    }
}

/// Runs `work` on all threads at once, five times. Returns the greatest sum of the threads' results per second.
fn best(threads: usize, work: impl Fn(usize) -> f64 + Sync) -> f64 {
    let round = |_| {
        let start = Instant::now();
        let sum: f64 = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..threads)
                .map(|k| {
                    scope.spawn({
                        let work = &work;
                        move || work(k)
                    })
                })
                .collect();
            threads.into_iter().map(|thread| thread.join().unwrap_or(0.0)).sum()
        });
        sum / start.elapsed().as_secs_f64()
    };
    (0..5).map(round).fold(0.0, f64::max)
}

/// GB/s of copies of buffers far larger than a core's caches.
fn copy(threads: usize) -> f64 {
    const BYTES: usize = 64 << 20;
    let buffers: Vec<_> =
        (0..threads).map(|_| std::sync::Mutex::new((vec![1u8; BYTES], vec![2u8; BYTES]))).collect();
    best(threads, |k| {
        let Ok(mut pair) = buffers[k].lock() else { return 0.0 };
        let (from, to) = &mut *pair;
        for _ in 0..8 {
            to.copy_from_slice(black_box(from));
            black_box(&mut *to);
        }
        (8 * 2 * BYTES) as f64
    }) * 1e-9
}

/// GFLOP/s of a * x + b on registers.
fn peak(threads: usize) -> f64 {
    best(threads, |_| multiply_add_best() as f64) * 1e-9
}

/// The number of independent lanes, enough to hide the latency of two pipes of the widest vectors.
const LANES: usize = 128;
const STEPS: u64 = 4_000_000;

/// Returns the number of floating-point operations done.
#[inline(always)]
fn multiply_add<const N: usize>() -> u64 {
    let mut x = black_box([1.0f32; N]);
    let (a, b) = (black_box(0.999f32), black_box(0.001f32));
    for _ in 0..STEPS {
        for x in &mut x {
            *x = *x * a + b;
        }
    }
    black_box(x);
    STEPS * 2 * N as u64
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn multiply_add_avx2() -> u64 {
    multiply_add::<{ LANES / 2 + LANES / 4 }>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn multiply_add_avx512() -> u64 {
    multiply_add::<{ 2 * LANES }>()
}

fn multiply_add_best() -> u64 {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the processor has these instructions.
            return unsafe { multiply_add_avx512() };
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has these instructions.
            return unsafe { multiply_add_avx2() };
        }
    }
    multiply_add::<{ LANES / 4 }>()
}
