//! Models that failed once.

use super::recipe::Recipe;

pub fn cases() -> Vec<(&'static str, Recipe)> {
    vec![]
}
