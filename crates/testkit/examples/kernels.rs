//! Solves a built-in scene on one thread with the kernels of one processor level, for `benches/kernels.sh`, which
//! counts the instructions of the last solve: in valgrind, which collects within `counted`, or, since that knows no
//! AVX-512, by a trap after each of them, with the counts in a file.
//!
//!     kernels LEVEL SCENE CELLS QUALITY [COUNTS]

use std::env::args;

use vrtm::{Asset, SolveOptions, Strided};
use vrtm_testkit::bench;

fn main() -> Result<(), String> {
    let words: Vec<String> = args().skip(1).collect();
    let [level, scene, cells, quality, counts @ ..] = &words[..] else {
        return Err("kernels LEVEL SCENE CELLS QUALITY [COUNTS]".into());
    };
    let options = SolveOptions { quality: bench::quality(quality)?, ..SolveOptions::default() };
    let model = bench::model(scene);
    let cells = cells.parse().map_err(|_| "CELLS is no number")?;
    bench::at_level(Some(level), || {
        let mut asset = model.asset(1, cells);
        // The first solve also allocates.
        asset.solve(model.frame(1), &options).expect("a solve");
        if let Some(path) = counts.first() {
            bench::write(path.as_ref(), &steps::counts(|| counted(&mut asset, model.frame(2), &options))?)?;
        } else {
            counted(&mut asset, model.frame(2), &options);
        }
        println!("{}", asset.tile(0).report().expect("a report").nodes_active);
        Ok(())
    })?
}

/// A name for valgrind.
#[unsafe(no_mangle)]
#[inline(never)]
fn counted(asset: &mut Asset, pose: Strided, options: &SolveOptions) {
    asset.solve(pose, options).expect("a solve");
}

#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
mod steps {
    use std::arch::asm;
    use std::ffi::{c_int, c_void};
    use std::fmt::Write;
    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

    unsafe extern "C" {
        // The linker's names for the beginning of the program and the end of its code.
        static __executable_start: u8;
        static etext: u8;
    }

    /// Executions of the instruction at each address of the program.
    static COUNTS: OnceLock<Vec<AtomicU32>> = OnceLock::new();

    extern "C" fn trapped(_: c_int, _: *mut libc::siginfo_t, context: *mut c_void) {
        // SAFETY: a handler with SA_SIGINFO gets the context of the thread.
        let registers = unsafe { (*context.cast::<libc::ucontext_t>()).uc_mcontext.gregs };
        let at = registers[libc::REG_RIP as usize] as usize;
        let start = &raw const __executable_start as usize;
        COUNTS
            .get()
            .and_then(|counts| counts.get(at.wrapping_sub(start)))
            .map(|count| count.fetch_add(1, Relaxed));
    }

    /// Executions of each of the program's instructions while `f` runs, on this thread, as callgrind writes them: the
    /// address in the file, no line, the number.
    pub fn counts(f: impl FnOnce()) -> Result<String, String> {
        let start = &raw const __executable_start as usize;
        let size = &raw const etext as usize - start;
        let counts = COUNTS.get_or_init(|| (0..size).map(|_| AtomicU32::new(0)).collect());
        // SAFETY: the handler has the type that SA_SIGINFO asks for, and zeros are an action's other values.
        let refused = unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = trapped as *const () as usize;
            action.sa_flags = libc::SA_SIGINFO | libc::SA_RESTART;
            libc::sigaction(libc::SIGTRAP, &raw const action, std::ptr::null_mut())
        };
        if refused != 0 {
            return Err("the system refuses a handler of traps".into());
        }
        // SAFETY: the flag has the processor trap after each instruction, and changes nothing else.
        unsafe { asm!("pushfq", "or qword ptr [rsp], 256", "popfq") };
        f();
        // SAFETY: as above.
        unsafe { asm!("pushfq", "and qword ptr [rsp], -257", "popfq") };
        let mut text = String::new();
        for (at, count) in counts.iter().map(|count| count.load(Relaxed)).enumerate().filter(|&(_, n)| n != 0)
        {
            writeln!(text, "{at:#x} 0 {count}").expect("a string takes all");
        }
        Ok(text)
    }
}

#[cfg(not(all(target_os = "linux", target_arch = "x86_64")))]
mod steps {
    pub fn counts(_: impl FnOnce()) -> Result<String, String> {
        Err("instructions are counted on x86-64 with Linux alone".into())
    }
}
