//! Views of a host's vertex arrays: any byte stride, f32 or f64, read without alignment.

use std::marker::PhantomData;

use crate::allocation::Vec;
use crate::error::{Result, ensure};

/// The number format of an array's components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Scalar {
    /// 32-bit float.
    F32,
    /// 64-bit float.
    F64,
}

impl Scalar {
    /// Bytes of one component.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }

    /// The number at the beginning of `bytes`.
    #[inline(always)]
    fn read(self, bytes: &[u8]) -> f64 {
        match self {
            Scalar::F32 => f32::from_ne_bytes(bytes[..4].try_into().unwrap()).into(),
            Scalar::F64 => f64::from_ne_bytes(bytes[..8].try_into().unwrap()),
        }
    }
}

/// An element of a packed array: [`f32`] or [`f64`], or an array of them, such as `[f32; 3]` or `[[f64; 3]; 3]`.
///
/// # Safety
/// The type consists of `COMPONENTS` numbers of the format `SCALAR` and of nothing else, padding included.
pub unsafe trait Element: Copy {
    /// The format of its numbers.
    const SCALAR: Scalar;
    /// Count of its numbers.
    const COMPONENTS: usize;
}

// SAFETY: one number.
unsafe impl Element for f32 {
    const SCALAR: Scalar = Scalar::F32;
    const COMPONENTS: usize = 1;
}

// SAFETY: one number.
unsafe impl Element for f64 {
    const SCALAR: Scalar = Scalar::F64;
    const COMPONENTS: usize = 1;
}

// SAFETY: arrays have no padding.
unsafe impl<T: Element, const N: usize> Element for [T; N] {
    const SCALAR: Scalar = T::SCALAR;
    const COMPONENTS: usize = N * T::COMPONENTS;
}

/// `count` elements of `components` scalars, each `stride` bytes after the one before it.
#[derive(Clone, Copy, Debug)]
pub struct Strided<'a> {
    bytes: &'a [u8],
    scalar: Scalar,
    components: usize,
    count: usize,
    stride: usize,
    factor: f64,
}

impl Default for Strided<'_> {
    /// No elements.
    fn default() -> Self {
        Strided { bytes: &[], scalar: Scalar::F32, components: 0, count: 0, stride: 0, factor: 1.0 }
    }
}

impl<'a> Strided<'a> {
    /// A view of raw bytes. `name` is the argument's name in error messages. `stride` 0 means tightly packed.
    ///
    /// # Example
    /// Positions among the other values of a vertex:
    ///
    /// ```
    /// # use vrtm::{Scalar, Strided};
    /// let vertices: [[f32; 5]; 2] = [[0.0, 1.0, 2.0, 0.25, 0.75], [3.0, 4.0, 5.0, 0.5, 0.5]];
    /// let bytes: Vec<u8> = vertices.as_flattened().iter().flat_map(|x| x.to_ne_bytes()).collect();
    /// let positions = Strided::new("positions", &bytes, Scalar::F32, 3, 2, 20)?;
    /// let uvs = Strided::new("uvs", &bytes[12..], Scalar::F32, 2, 2, 20)?;
    /// assert_eq!(positions.get3(1), [3.0, 4.0, 5.0]);
    /// assert_eq!([uvs.get(0, 0), uvs.get(0, 1)], [0.25, 0.75]);
    /// assert!(Strided::new("positions", &bytes, Scalar::F32, 3, 3, 20).is_err(), "there are two vertices");
    /// # Ok::<(), vrtm::Error>(())
    /// ```
    pub fn new(
        name: &str,
        bytes: &'a [u8],
        scalar: Scalar,
        components: usize,
        count: usize,
        stride: usize,
    ) -> Result<Strided<'a>> {
        let element = scalar.size() * components;
        let stride = if stride == 0 { element } else { stride };
        ensure!(
            stride >= element,
            "{name}: stride is {stride} bytes, smaller than an element ({element} bytes)"
        );
        let needed = count.checked_sub(1).map_or(Some(0), |n| n.checked_mul(stride)?.checked_add(element));
        let given = bytes.len();
        ensure!(
            needed.is_some_and(|needed| needed <= given),
            "{name}: {count} elements with stride {stride} do not fit into {given} bytes"
        );
        Ok(Strided { bytes, scalar, components, count, stride, factor: 1.0 })
    }

    /// A view of packed elements: positions, UVs, one value per vertex.
    ///
    /// ```
    /// # use vrtm::Strided;
    /// let positions = vec![[0.0f32, 1.0, 2.0], [3.0, 4.0, 5.0]];
    /// assert_eq!(Strided::from_slice(&positions).components(), 3);
    /// assert_eq!(Strided::from_slice(&[0.5f64, 0.75]).components(), 1);
    /// ```
    #[must_use]
    pub fn from_slice<T: Element>(values: &'a [T]) -> Strided<'a> {
        let (bytes, stride) = (as_bytes(values), size_of::<T>());
        Strided {
            bytes,
            scalar: T::SCALAR,
            components: T::COMPONENTS,
            count: values.len(),
            stride,
            factor: 1.0,
        }
    }

    /// The same elements, which [`Strided::get3`] multiplies by a finite factor.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Strided<'a> {
        Strided { factor, ..self }
    }

    /// The factor of [`Strided::scaled`], or 1.
    pub fn factor(&self) -> f64 {
        self.factor
    }

    /// Number of elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count
    }

    /// True if the view has no elements.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Components per element.
    #[must_use]
    pub fn components(&self) -> usize {
        self.components
    }

    /// The machine epsilon of its number format.
    #[doc(hidden)]
    pub fn epsilon(&self) -> f64 {
        match self.scalar {
            Scalar::F32 => f32::EPSILON.into(),
            Scalar::F64 => f64::EPSILON,
        }
    }

    /// Component `c` of element `i`, as f64 (exact for f32).
    ///
    /// # Panics
    /// If `i` or `c` is out of range.
    #[must_use]
    pub fn get(&self, i: usize, c: usize) -> f64 {
        assert!(i < self.count && c < self.components);
        self.scalar.read(&self.bytes[i * self.stride + c * self.scalar.size()..])
    }

    /// The first three components of element `i`.
    ///
    /// # Panics
    /// If `i` is out of range, or elements have fewer components.
    #[must_use]
    pub fn get3(&self, i: usize) -> [f64; 3] {
        assert!(i < self.count && self.components >= 3);
        let element = &self.bytes[i * self.stride..][..3 * self.scalar.size()];
        // As finite as the positions are.
        let component = |c: usize| {
            let value = self.scalar.read(&element[c * self.scalar.size()..]);
            if value.is_finite() { (value * self.factor).clamp(f64::MIN, f64::MAX) } else { value }
        };
        [component(0), component(1), component(2)]
    }

    /// Errors with the index of the first component that is not finite.
    #[doc(hidden)]
    pub fn check_finite(&self, name: &str) -> Result<()> {
        self.check(name, f64::is_finite)
    }

    /// Errors with the index of the first component that is not finite as f32.
    #[doc(hidden)]
    pub fn check_f32(&self, name: &str) -> Result<()> {
        self.check(name, |value| (value as f32).is_finite())
    }

    /// Errors with the index of the first component that is not `good`.
    fn check(&self, name: &str, good: impl Fn(f64) -> bool) -> Result<()> {
        // Read as one format throughout: a call checks all positions of its pose.
        let is_bad = |i: usize, scalar: Scalar| {
            let element = &self.bytes[i * self.stride..][..self.components * scalar.size()];
            element.chunks_exact(scalar.size()).any(|component| !good(scalar.read(component)))
        };
        let bad = match self.scalar {
            Scalar::F32 => (0..self.count).find(|&i| is_bad(i, Scalar::F32)),
            Scalar::F64 => (0..self.count).find(|&i| is_bad(i, Scalar::F64)),
        };
        let Some(i) = bad else { return Ok(()) };
        for c in 0..self.components {
            let value = self.get(i, c);
            let why = if value.is_finite() { ", which is beyond f32" } else { "" };
            ensure!(good(value), "{name}[{i}]: component {c} is {value}{why}");
        }
        Ok(())
    }
}

/// A host's array to write to: `count` elements of `components` scalars, each `stride` bytes after the one before it.
#[derive(Debug)]
pub struct StridedMut<'a> {
    first: *mut u8,
    scalar: Scalar,
    components: usize,
    count: usize,
    stride: usize,
    bytes: PhantomData<&'a mut [u8]>,
}

// SAFETY: elements are written through `put` alone, whose caller keeps threads apart.
unsafe impl Sync for StridedMut<'_> {}
// SAFETY: the memory is lent by a `&mut`, or by a host for all threads of a call.
unsafe impl Send for StridedMut<'_> {}

impl<'a> StridedMut<'a> {
    /// A view of raw bytes, as with [`Strided::new`].
    pub fn new(
        name: &str,
        bytes: &'a mut [u8],
        scalar: Scalar,
        components: usize,
        count: usize,
        stride: usize,
    ) -> Result<StridedMut<'a>> {
        let stride = Strided::new(name, bytes, scalar, components, count, stride)?.stride;
        let first = bytes.as_mut_ptr();
        Ok(StridedMut { first, scalar, components, count, stride, bytes: PhantomData })
    }

    /// A view of memory in which other arrays may lie between the elements.
    ///
    /// # Safety
    /// The elements are writable, and nothing else uses them, as long as the view is used.
    pub unsafe fn from_raw(
        first: *mut u8,
        scalar: Scalar,
        components: usize,
        count: usize,
        stride: usize,
    ) -> StridedMut<'a> {
        StridedMut { first, scalar, components, count, stride, bytes: PhantomData }
    }

    /// A view of packed elements to be written: positions, quaternions, matrices.
    #[must_use]
    pub fn from_slice<T: Element>(values: &'a mut [T]) -> StridedMut<'a> {
        // SAFETY: the elements are borrowed for as long as the view lives.
        unsafe {
            Self::from_raw(values.as_mut_ptr().cast(), T::SCALAR, T::COMPONENTS, values.len(), size_of::<T>())
        }
    }

    /// Number of elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count
    }

    /// True if the view has no elements.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Components per element.
    #[must_use]
    pub fn components(&self) -> usize {
        self.components
    }

    /// The address of an element.
    #[inline(always)]
    #[doc(hidden)]
    pub fn address(&self, i: usize) -> *const u8 {
        self.first.wrapping_add(i * self.stride)
    }

    /// Writes an element.
    ///
    /// # Panics
    /// If `i` is out of range, or the number of values is not that of the components.
    ///
    /// # Safety
    /// No other thread writes the same element at the same time.
    #[inline(always)]
    pub unsafe fn put<const N: usize>(&self, i: usize, values: [f64; N]) {
        assert!(i < self.count && N == self.components);
        // SAFETY: within the array, by the checks of `new` or the promise of `from_raw`; never aligned for certain.
        unsafe {
            let element = self.first.add(i * self.stride);
            match self.scalar {
                Scalar::F32 => element.cast::<[f32; N]>().write_unaligned(values.map(|value| value as f32)),
                Scalar::F64 => element.cast::<[f64; N]>().write_unaligned(values),
            }
        }
    }
}

/// A copy of a host's array, tightly packed.
#[derive(Clone, Debug)]
pub struct Packed {
    bytes: Vec<u8>,
    scalar: Scalar,
    components: usize,
    count: usize,
    factor: f64,
}

impl Packed {
    pub fn copy(from: &Strided) -> Packed {
        let Strided { scalar, components, count, factor, .. } = *from;
        let element = scalar.size() * components;
        let mut bytes = Vec::with_capacity(count * element);
        for i in 0..count {
            bytes.extend_from_slice(&from.bytes[i * from.stride..][..element]);
        }
        Packed { bytes, scalar, components, count, factor }
    }

    pub fn view(&self) -> Strided<'_> {
        let Packed { scalar, components, count, factor, .. } = *self;
        let stride = scalar.size() * components;
        Strided { bytes: &self.bytes, scalar, components, count, stride, factor }
    }
}

/// The bytes of plain numbers.
pub fn as_bytes<T: Copy>(values: &[T]) -> &[u8] {
    // SAFETY: only called with numbers and arrays of them, which have no padding; any byte may be read as u8.
    unsafe { std::slice::from_raw_parts(values.as_ptr().cast(), std::mem::size_of_val(values)) }
}
