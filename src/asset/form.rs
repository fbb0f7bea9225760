//! The forms of a redirection.

use glam::DVec2;

use crate::mesh::TileMesh;

use super::kind::FetchKind;

/// What a redirection's values are measured from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Form {
    /// The tile's corner (0, 0).
    Tile,
    /// The corner (0, 0) of tile 1001; the tile's own corner is held here.
    Udim(DVec2),
    /// The texel's centre.
    Delta,
}

impl Form {
    /// The form of a kind of output of a tile.
    pub fn new(kind: FetchKind, tile: &TileMesh) -> Form {
        match kind {
            FetchKind::RedirectionDelta => Form::Delta,
            FetchKind::RedirectionUdim => Form::Udim(tile.origin()),
            _ => Form::Tile,
        }
    }

    /// What is written for a redirected UV within the tile, `delta` away from the texel's centre.
    pub fn value(self, uv: [f64; 2], delta: [f64; 2]) -> [f64; 2] {
        match self {
            Form::Tile => uv,
            Form::Udim(origin) => (DVec2::from(uv) + origin).into(),
            Form::Delta => delta,
        }
    }

    /// The way from the texel's centre to the redirected UV that a value stands for: the inverse of `value`.
    pub fn delta(self, value: [f64; 2], centre: [f64; 2]) -> [f64; 2] {
        let origin = match self {
            Form::Tile => DVec2::ZERO,
            Form::Udim(origin) => origin,
            Form::Delta => return value,
        };
        (DVec2::from(value) - origin - DVec2::from(centre)).into()
    }
}
