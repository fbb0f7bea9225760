//! The house itself: who imports whom, and whether the documents' links lead anywhere. Nothing of the library is run.

mod arrows;
mod bindings;
mod links;
