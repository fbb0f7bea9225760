//! The house itself: who imports whom, whether the links of documents lead anywhere, what is packed, and how comments begin.
//! Nothing of the library is run.

mod arrows;
mod bindings;
mod links;
mod packages;
mod size;
mod words;
