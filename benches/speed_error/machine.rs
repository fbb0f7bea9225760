//! The machine on which times are measured.

pub struct Machine {
    pub cpu: String,
    pub threads: usize,
    /// The widest vector instructions that the processor has.
    pub simd: &'static str,
    pub compiler: String,
    pub adapters: Vec<String>,
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
        }
    }

    pub fn text(&self) -> String {
        let adapters = if self.adapters.is_empty() { "none".into() } else { self.adapters.join(", ") };
        format!(
            "{}, {} threads, {}; {}; GPU adapters: {adapters}.",
            self.cpu, self.threads, self.simd, self.compiler
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
