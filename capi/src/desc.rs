//! Checks a host's pointers and converts them to Rust values: structs that may grow, arrays, bytes.

use std::ffi::c_void;
use std::mem::{MaybeUninit, align_of, size_of};
use std::ptr;

use super::status::{Failure, Outcome};

/// A struct of the C API that may grow at its end.
///
/// # Safety
/// `#[repr(C)]`, first field `struct_size: u32`, no padding after the last field, and all zeros is a valid value.
pub(super) unsafe trait Sized32: Copy {
    /// `sizeof` in the first version that had the struct: no host passes less. A struct that has grown since overrides
    /// this.
    const FIRST: usize = size_of::<Self>();
    /// Its name in C, for messages.
    const NAME: &'static str;

    /// All zeros except for the size: the result of its _init() function, unless it has nonzero defaults.
    fn zeroed() -> Self {
        let mut value = MaybeUninit::<Self>::zeroed();
        // SAFETY: the size comes first, and all zeros is a valid value (trait contract).
        unsafe {
            value.as_mut_ptr().cast::<u32>().write(size_of::<Self>() as u32);
            value.assume_init()
        }
    }
}

/// Implements [`Sized32`], whose contract they keep, for structs, with the first size of those that have grown.
macro_rules! sized {
    ($($name:ident $(= $first:literal)?),+) => {
        $(unsafe impl $crate::desc::Sized32 for $name {
            $(const FIRST: usize = $first;)?
            const NAME: &'static str = stringify!($name);
        })+
    };
}
pub(super) use sized;

/// Far larger than any struct: a larger `struct_size` must be uninitialised memory.
pub(super) const LARGEST: usize = 4096;

fn checked_size<T: Sized32>(pointer: *const T, name: &str) -> Outcome<usize> {
    check_pointer(pointer, name)?;
    // SAFETY: not null, aligned; the host vouches for at least the first field (head of the header).
    let size = unsafe { pointer.cast::<u32>().read() } as usize;
    ensure!(
        (T::FIRST..=LARGEST).contains(&size),
        "{name}.struct_size is {size}, but {} has {} bytes: start from {}_init()",
        T::NAME,
        size_of::<T>(),
        T::NAME
    );
    Ok(size)
}

fn check_pointer<T>(pointer: *const T, name: &str) -> Outcome<()> {
    ensure!(!pointer.is_null(), "{name} is null");
    ensure!(pointer.is_aligned(), "{name} is not aligned to {} bytes", align_of::<T>());
    Ok(())
}

/// Reads a host's struct. Fields that an older host lacks become zero; fields that this library does not know must be
/// zero.
pub(super) unsafe fn read<T: Sized32>(pointer: *const T, name: &str) -> Outcome<T> {
    let size = checked_size(pointer, name)?;
    let known = size.min(size_of::<T>());
    let mut value = MaybeUninit::<T>::zeroed();
    // SAFETY: the host's struct has `size` bytes; zeroed and overwritten in part it is a valid T (trait contract).
    let value = unsafe {
        ptr::copy_nonoverlapping(pointer.cast::<u8>(), value.as_mut_ptr().cast::<u8>(), known);
        value.assume_init()
    };
    for at in known..size {
        // SAFETY: inside the host's struct.
        if unsafe { pointer.cast::<u8>().add(at).read() } != 0 {
            return Err(Failure::unsupported(format!(
                "{name}: a field after the first {known} bytes is set, which this version of the library does not have"
            )));
        }
    }
    Ok(value)
}

/// Like [`read`]; null gives the defaults.
pub(super) unsafe fn read_or_default<T: Sized32 + Default>(pointer: *const T, name: &str) -> Outcome<T> {
    if pointer.is_null() {
        return Ok(T::default());
    }
    // SAFETY: passed on.
    unsafe { read(pointer, name) }
}

/// Writes a host's output struct, which is checked before the work that makes its value: the fields that the host
/// knows, but for `struct_size`. Fields that this library does not know become zero.
pub(super) fn fill<T: Sized32>(
    pointer: *mut T,
    name: &str,
    work: impl FnOnce() -> Outcome<T>,
) -> Outcome<()> {
    let size = checked_size(pointer.cast_const(), name)?;
    let value = work()?;
    let skip = size_of::<u32>();
    let known = size.min(size_of::<T>());
    // SAFETY: the host's struct has `size` bytes, which were checked to hold `struct_size`.
    unsafe {
        let to = pointer.cast::<u8>();
        ptr::copy_nonoverlapping(ptr::from_ref(&value).cast::<u8>().add(skip), to.add(skip), known - skip);
        ptr::write_bytes(to.add(known), 0, size - known);
    }
    Ok(())
}

/// Writes a plain output value, such as a handle or a count, to a place that is checked before the work that makes it.
pub(super) fn put<T: Copy>(pointer: *mut T, name: &str, work: impl FnOnce() -> Outcome<T>) -> Outcome<()> {
    check_pointer(pointer.cast_const(), name)?;
    let value = work()?;
    // SAFETY: not null and aligned; the host vouches for the memory.
    unsafe { pointer.write(value) };
    Ok(())
}

fn check_span<T>(pointer: *const T, count: usize, name: &str) -> Outcome<()> {
    check_pointer(pointer, name)?;
    let bytes = count.checked_mul(size_of::<T>()).filter(|&n| n <= isize::MAX as usize);
    match bytes.and_then(|bytes| pointer.addr().checked_add(bytes)) {
        Some(_) => Ok(()),
        None => Err(Failure::argument(format!("{name}: {count} elements exceed the address space"))),
    }
}

/// A host's array of plain numbers.
pub(super) unsafe fn slice<'a, T: Copy>(pointer: *const T, count: usize, name: &str) -> Outcome<&'a [T]> {
    check_span(pointer, count, name)?;
    // SAFETY: not null, aligned, within the address space; the host vouches for `count` elements during the call.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// Like [`slice`]; null gives `None`.
pub(super) unsafe fn slice_or_none<'a, T: Copy>(
    pointer: *const T,
    count: usize,
    name: &str,
) -> Outcome<Option<&'a [T]>> {
    // SAFETY: passed on.
    (!pointer.is_null()).then(|| unsafe { slice(pointer, count, name) }).transpose()
}

/// A host's array of plain numbers to write to.
pub(super) unsafe fn slice_mut<'a, T: Copy>(
    pointer: *mut T,
    count: usize,
    name: &str,
) -> Outcome<&'a mut [T]> {
    check_span(pointer, count, name)?;
    // SAFETY: as in `slice`, and no other thread touches the memory during the call.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, count) })
}

/// The pointer that a host's functions get, on whichever thread they are called.
#[derive(Clone, Copy)]
pub(super) struct User(pub *mut c_void);

// SAFETY: the library only passes it on, and the header tells the host on which threads its functions are called.
unsafe impl Send for User {}
// SAFETY: as above.
unsafe impl Sync for User {}

impl User {
    pub fn pointer(self) -> *mut c_void {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Now {
        struct_size: u32,
        a: u32,
        b: u32,
    }

    // SAFETY: plain numbers.
    unsafe impl Sized32 for Now {
        const FIRST: usize = 8;
        const NAME: &'static str = "vrtm_now";
    }

    /// No input struct has grown yet: hosts in C cannot show this.
    #[test]
    fn an_older_host_s_missing_fields_are_zero() {
        let old = Now { struct_size: 8, a: 1, b: 99 };
        // SAFETY: a living struct of 12 bytes.
        assert_eq!(unsafe { read(&raw const old, "desc") }.unwrap(), Now { struct_size: 8, a: 1, b: 0 });
    }
}
