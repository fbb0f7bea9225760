//! Typed arrays of JavaScript.

use js_sys::{Float32Array, Float64Array, Uint8Array, Uint8ClampedArray, Uint16Array, Uint32Array};
use vrtm::{Error, ErrorKind, ImageLayout, ImageView, PixelFormat, Result, Scalar, Strided};
use wasm_bindgen::{JsCast, JsValue};

/// A copy of an array, with the name that errors call it by.
pub struct Array {
    name: String,
    bytes: Vec<u8>,
    /// Bytes of a number.
    size: usize,
    scalar: Option<Scalar>,
    /// As a channel of a texel. A `Uint32Array` is neither: it has indices.
    format: Option<PixelFormat>,
}

/// Memory of this size; an error that can be caught where there is none, and not the end of the module.
pub fn zeros(bytes: u64) -> Result<Vec<u8>> {
    let short = || Error::new(ErrorKind::OutOfMemory, format!("out of memory: {bytes} bytes"));
    let count = usize::try_from(bytes).map_err(|_| short())?;
    let mut zeros = Vec::new();
    zeros.try_reserve_exact(count).map_err(|_| short())?;
    zeros.resize(count, 0);
    Ok(zeros)
}

impl Array {
    pub fn new(name: impl Into<String>, value: &JsValue) -> Result<Array> {
        let name = name.into();
        let kinds = [
            (value.is_instance_of::<Float32Array>(), 4, Some(Scalar::F32), Some(PixelFormat::F32)),
            (value.is_instance_of::<Float64Array>(), 8, Some(Scalar::F64), None),
            (value.is_instance_of::<Uint32Array>(), 4, None, None),
            (value.is_instance_of::<Uint16Array>(), 2, None, Some(PixelFormat::U16)),
            (value.is_instance_of::<Uint8Array>(), 1, None, Some(PixelFormat::U8)),
            (value.is_instance_of::<Uint8ClampedArray>(), 1, None, Some(PixelFormat::U8)),
        ];
        let Some((_, size, scalar, format)) = kinds.into_iter().find(|(is, ..)| *is) else {
            return Err(Error::argument(format!("{name}: a typed array is expected")));
        };
        // All typed arrays have these.
        let array: &Uint8Array = value.unchecked_ref();
        let mut bytes = zeros(array.byte_length().into())?;
        // That of an array which was sent to a worker is empty, and has no views.
        if !bytes.is_empty() {
            let [first, length] = [array.byte_offset(), array.byte_length()];
            Uint8Array::new_with_byte_offset_and_length(&array.buffer(), first, length).copy_to(&mut bytes);
        }
        Ok(Array { name, bytes, size, scalar, format })
    }

    /// The number of its numbers.
    pub fn len(&self) -> usize {
        self.bytes.len() / self.size
    }

    fn error(&self, what: &str) -> Error {
        Error::argument(format!("{}: {what}", self.name))
    }

    pub fn strided(&self, components: usize) -> Result<Strided<'_>> {
        let wrong = || self.error("a Float32Array or a Float64Array is expected");
        let (scalar, numbers) = (self.scalar.ok_or_else(wrong)?, self.len());
        if !numbers.is_multiple_of(components) {
            return Err(self.error(&format!("{numbers} numbers are no multiple of {components}")));
        }
        Strided::new(&self.name, &self.bytes, scalar, components, numbers / components, 0)
    }

    pub fn u32s(&self) -> Result<Vec<u32>> {
        if self.scalar.is_some() || self.format.is_some() {
            return Err(self.error("a Uint32Array is expected"));
        }
        Ok(self.bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }

    fn bytes_of(&self, format: PixelFormat, kind: &str) -> Result<&[u8]> {
        let wrong = || self.error(&format!("a {kind} is expected"));
        if self.format == Some(format) { Ok(&self.bytes) } else { Err(wrong()) }
    }

    pub fn u8s(&self) -> Result<&[u8]> {
        self.bytes_of(PixelFormat::U8, "Uint8Array")
    }

    /// The bytes of half floats.
    pub fn halves(&self) -> Result<&[u8]> {
        self.bytes_of(PixelFormat::U16, "Uint16Array")
    }

    /// An image of one channel, first row at v = 1.
    pub fn image(&self, [width, height]: [u32; 2]) -> Result<ImageView<'_>> {
        let wrong = || self.error("a Uint8Array, a Uint16Array or a Float32Array is expected");
        let (format, texels) = (self.format.ok_or_else(wrong)?, self.len());
        if texels as u64 != u64::from(width) * u64::from(height) {
            return Err(self.error(&format!("{texels} values for {width} x {height} texels")));
        }
        ImageView::new(&self.name, &self.bytes, ImageLayout::packed(width, height, format))
    }
}
