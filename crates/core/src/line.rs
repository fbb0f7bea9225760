//! Lines of text in fixed-size buffers, without allocation.

use std::fmt::{self, Write};

/// A zero-terminated line of text in a fixed-size buffer: messages must not need memory when memory is short.
#[derive(Clone, Copy)]
pub struct Line<const N: usize> {
    bytes: [u8; N],
    length: usize,
}

#[allow(clippy::new_without_default, reason = "a default cannot be constant")]
impl<const N: usize> Line<N> {
    /// An empty line.
    pub const fn new() -> Line<N> {
        Line { bytes: [0; N], length: 0 }
    }

    /// The text and its terminating zeros.
    pub fn bytes(&self) -> &[u8; N] {
        &self.bytes
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        std::str::from_utf8(&self.bytes[..self.length]).unwrap_or("")
    }
}

impl<const N: usize> Write for Line<N> {
    /// Cuts at a character boundary; a zero or a line break inside the text becomes a space.
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            let character = if matches!(character, '\0' | '\n' | '\r') { ' ' } else { character };
            let end = self.length + character.len_utf8();
            if end >= N {
                return Err(fmt::Error);
            }
            character.encode_utf8(&mut self.bytes[self.length..end]);
            self.length = end;
        }
        Ok(())
    }
}
