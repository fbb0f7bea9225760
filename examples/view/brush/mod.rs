//! The brush (`kind`): the point under the mouse (`pick`) and that opposite to it (`mirror`), what a stroke changes
//! in the maps (`painter`, on the surface of `vrtm_paint`), maps from textures (`textures`), tools that change all of
//! a map (`whole`), and taking back what was done (`steps`).

pub mod canvas;
pub mod kind;
pub mod mirror;
pub mod painter;
pub mod pick;
pub mod steps;
pub mod textures;
pub mod whole;
