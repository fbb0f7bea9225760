//! The processor's floating-point mode. Hosts may change how results are rounded, have tiny ones flushed to zero, or
//! have exceptions trapped; the compiler, and the promise of equal bits, assume none of this. Each exported function
//! therefore works in the default mode, as do the threads that it starts, and leaves the host's mode as it was.

/// The host's mode, which is restored when this is dropped.
pub struct FloatMode(Word);

impl FloatMode {
    /// Changes to the default mode: rounding to nearest, no flushing to zero, no traps.
    pub fn set_default() -> FloatMode {
        let host = read();
        write(DEFAULT);
        FloatMode(host)
    }
}

impl Drop for FloatMode {
    fn drop(&mut self) {
        // This also restores the exception flags that the host had seen, and drops ours.
        write(self.0);
    }
}

#[cfg(all(target_arch = "x86_64", not(miri)))]
pub use x86_64::{DEFAULT, Word, read, write};

#[cfg(all(target_arch = "x86_64", not(miri)))]
pub mod x86_64 {
    use std::arch::asm;

    /// The MXCSR register.
    pub type Word = u32;

    /// All exceptions masked.
    pub const DEFAULT: Word = 0x1f80;

    pub fn read() -> Word {
        let mut word = 0;
        // SAFETY: writes the register to the variable.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut word, options(nostack, preserves_flags)) };
        word
    }

    pub fn write(word: Word) {
        // SAFETY: the value is the default that Rust code expects, or the caller's own on return to it.
        unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const word, options(nostack, preserves_flags)) };
    }
}

#[cfg(all(target_arch = "aarch64", not(miri)))]
pub use aarch64::{DEFAULT, Word, read, write};

#[cfg(all(target_arch = "aarch64", not(miri)))]
mod aarch64 {
    use std::arch::asm;

    /// The FPCR register.
    pub type Word = u64;

    pub const DEFAULT: Word = 0;

    pub fn read() -> Word {
        let word;
        // SAFETY: reads the register.
        unsafe { asm!("mrs {}, fpcr", out(reg) word, options(nomem, nostack, preserves_flags)) };
        word
    }

    pub fn write(word: Word) {
        // SAFETY: the value is the default that Rust code expects, or the caller's own on return to it.
        unsafe { asm!("msr fpcr, {}", in(reg) word, options(nostack, preserves_flags)) };
    }
}

#[cfg(any(miri, not(any(target_arch = "x86_64", target_arch = "aarch64"))))]
pub use other::{DEFAULT, Word, read, write};

/// Other processors, and Miri, which reads no assembly, keep the host's mode.
#[cfg(any(miri, not(any(target_arch = "x86_64", target_arch = "aarch64"))))]
mod other {
    pub type Word = ();

    pub const DEFAULT: Word = ();

    pub fn read() -> Word {}

    pub fn write(_: Word) {}
}
