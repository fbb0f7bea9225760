//! Rigidity maps from a texture and from a brush, for programs in which artists paint: the viewer, and web pages by
//! the npm package. Maps have 8 bits, 255 = rigid, and any row first, as the texture has.
//!
//! The definitions are those of `bindings/python/src/vrtm/rigidity.py`. `agreed.txt`, which the tests of both read,
//! has results of that.

#![forbid(unsafe_code)]

// Ordered from the bottom up: a module imports only modules above it in this list.
mod plane;
mod picture;
mod detail;
mod brush;
#[cfg(test)]
mod tests;

pub use brush::{MARGIN, Surface, closest, cover, mixed};
pub use detail::of_detail;
pub use picture::{Picture, of_brightness, of_colour, otsu};
pub use plane::fitted;
