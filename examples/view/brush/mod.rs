//! The brush: the point under the mouse (`pick`), what of the surface lies around it (`disc`), which triangle is at a
//! texel (`ids`), and what a stroke changes in the maps (`painter`).

pub mod canvas;
pub mod disc;
pub mod ids;
pub mod painter;
pub mod pick;
