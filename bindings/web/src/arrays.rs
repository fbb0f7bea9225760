//! Typed arrays of JavaScript.

use js_sys::{Float32Array, Float64Array, Uint8Array, Uint8ClampedArray, Uint16Array, Uint32Array};
use vrtm::{Error, ImageLayout, ImageView, PixelFormat, Result, Scalar, Strided};
use wasm_bindgen::{JsCast, JsValue};

/// A copy of an array.
pub struct Array {
    bytes: Vec<u8>,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    U8,
    U16,
    U32,
    F32,
    F64,
}

impl Kind {
    fn size(self) -> usize {
        match self {
            Kind::U8 => 1,
            Kind::U16 => 2,
            Kind::U32 | Kind::F32 => 4,
            Kind::F64 => 8,
        }
    }
}

impl Array {
    pub fn new(name: &str, value: &JsValue) -> Result<Array> {
        let is = |kind: Kind, yes: bool| yes.then_some(kind);
        let kind = is(Kind::F32, value.is_instance_of::<Float32Array>())
            .or(is(Kind::F64, value.is_instance_of::<Float64Array>()))
            .or(is(Kind::U32, value.is_instance_of::<Uint32Array>()))
            .or(is(Kind::U16, value.is_instance_of::<Uint16Array>()))
            .or(is(Kind::U8, value.is_instance_of::<Uint8Array>()))
            .or(is(Kind::U8, value.is_instance_of::<Uint8ClampedArray>()));
        let kind = kind.ok_or_else(|| Error::argument(format!("{name}: a typed array is expected")))?;
        // All typed arrays have these.
        let array: &Uint8Array = value.unchecked_ref();
        let bytes = Uint8Array::new_with_byte_offset_and_length(
            &array.buffer(),
            array.byte_offset(),
            array.byte_length(),
        );
        Ok(Array { bytes: bytes.to_vec(), kind })
    }

    /// A map's values; `None` for `null` and `undefined`.
    pub fn of_map(name: &str, value: &JsValue) -> Result<Option<Array>> {
        if value.is_null() || value.is_undefined() { Ok(None) } else { Array::new(name, value).map(Some) }
    }

    pub fn strided(&self, name: &str, components: usize) -> Result<Strided<'_>> {
        let scalar = match self.kind {
            Kind::F32 => Scalar::F32,
            Kind::F64 => Scalar::F64,
            _ => {
                return Err(Error::argument(format!("{name}: a Float32Array or a Float64Array is expected")));
            }
        };
        let element = self.kind.size() * components;
        if !self.bytes.len().is_multiple_of(element) {
            let numbers = self.bytes.len() / self.kind.size();
            return Err(Error::argument(format!(
                "{name}: {numbers} numbers are no multiple of {components}"
            )));
        }
        Strided::new(name, &self.bytes, scalar, components, self.bytes.len() / element, 0)
    }

    pub fn u32s(&self, name: &str) -> Result<Vec<u32>> {
        if self.kind != Kind::U32 {
            return Err(Error::argument(format!("{name}: a Uint32Array is expected")));
        }
        Ok(self.bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }

    /// An image of one channel, first row at v = 1.
    pub fn image(&self, name: &str, [width, height]: [u32; 2]) -> Result<ImageView<'_>> {
        let format = match self.kind {
            Kind::U8 => PixelFormat::U8,
            Kind::U16 => PixelFormat::U16,
            Kind::F32 => PixelFormat::F32,
            _ => {
                let message = format!("{name}: a Uint8Array, a Uint16Array or a Float32Array is expected");
                return Err(Error::argument(message));
            }
        };
        let [texels, expected] = [self.bytes.len() / format.size(), width as usize * height as usize];
        if texels != expected {
            return Err(Error::argument(format!("{name}: {texels} values for {width} x {height} texels")));
        }
        ImageView::new(name, &self.bytes, ImageLayout::packed(width, height, format))
    }
}
