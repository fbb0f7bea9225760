//! The course of a carrier's points on the tiles of results, kept for the next fetch.

use crate::asset::derived::Same;
use crate::device::Booked;
use vrtm_carry::Course;
use vrtm_core::allocation::Vec;
use vrtm_core::grid::Grid;
use vrtm_core::mesh::TileMesh;

/// Key of a course: per tile, its connectivity, with collars or not, and its grid.
pub type Key = Vec<Option<(Same<TileMesh>, Option<Same<TileMesh>>, Same<Grid>)>>;

/// A course with its key.
#[derive(Debug)]
pub struct Kept {
    pub key: Key,
    pub course: Course,
    pub booked: Booked,
}
