//! The forms of a redirection.

use super::kind::FetchKind;

/// What a redirection's values are measured from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Form {
    /// The tile's corner (0, 0).
    Tile,
    /// The corner (0, 0) of the first tile, when the own one's is here.
    Udim([f64; 2]),
    /// The texel's centre.
    Delta,
}

impl Form {
    /// The form of a kind of output, of the tile with this UDIM number.
    pub fn new(kind: FetchKind, udim: u32) -> Form {
        match kind {
            FetchKind::RedirectionDelta => Form::Delta,
            FetchKind::RedirectionUdim => {
                let tile = udim - 1001;
                Form::Udim([f64::from(tile % 10), f64::from(tile / 10)])
            }
            _ => Form::Tile,
        }
    }

    /// What is written for a redirected UV within the tile, `delta` away from the texel's centre.
    pub fn value(self, uv: [f64; 2], delta: [f64; 2]) -> [f64; 2] {
        match self {
            Form::Tile => uv,
            Form::Udim(origin) => [uv[0] + origin[0], uv[1] + origin[1]],
            Form::Delta => delta,
        }
    }

    /// The way from the texel's centre to the redirected UV that a value stands for: the inverse of `value`.
    pub fn delta(self, value: [f64; 2], centre: [f64; 2]) -> [f64; 2] {
        let origin = match self {
            Form::Tile => [0.0; 2],
            Form::Udim(origin) => origin,
            Form::Delta => return value,
        };
        [0, 1].map(|k| value[k] - origin[k] - centre[k])
    }
}
