//! The images that a host fetches: the redirection and other images of a tile (`fetch`), W⁻¹ at texel centres
//! (`inverse`), and a map's certificate (`certificate`).

pub(crate) mod canvas;
pub(crate) mod certificate;
pub(crate) mod dilation;
pub(crate) mod external;
pub(crate) mod fetch;
pub(crate) mod inverse;
pub(crate) mod nodes;
mod uv_set;

use std::fmt::Display;
use std::ops::RangeInclusive;

use glam::DVec2;

use vrtm_core::error::Result;
use vrtm_core::mesh::TileMesh;

/// The content of a fetched image, f32 or f16. UVs have two channels (u, v); an image may have a third channel, which
/// is 0, and a redirection a fourth, which is 1 where a chart covers the texel's centre and 0 elsewhere. (Image
/// programs read a two-channel file as luminance and alpha.)
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FetchKind {
    /// Inverse warp at texel centres, absolute within the tile (0..1). f16 resolves less than a texel only below 1024
    /// texels.
    Redirection,
    /// Inverse warp minus the texel centre, in UV.
    RedirectionDelta,
    /// The warp itself, absolute within the tile, from border to border: (nx+1) x (ny+1) texels give the nodes exactly.
    /// At any other size each cell is two triangles, split by its diagonal from (0,0) to (1,1), and the warp is affine
    /// on each; the redirection inverts this warp. Nodes of [`crate::Solver::Pbd`] may lie slightly outside of the
    /// tile.
    Warp,
    /// The redirection plus the tile's offset (U, V): absolute among all tiles, as the mesh's own UVs are.
    RedirectionUdim,
    /// Derivatives of the redirection (u', v') by the UV at texel centres, four channels: du'/du, du'/dv, dv'/du,
    /// dv'/dv.
    Jacobian,
    /// Largest singular value of `Jacobian`, one channel: how many times wider a lookup's footprint is in the texture
    /// than on the surface.
    FilterScale,
    /// The UV in the UV set with this number, as the mesh has it there, of the point of the surface that the
    /// redirection leads to: the map is looked up by the UVs of the tile's set, and gives those of another set. 0
    /// beside charts, but for a margin of two texels, which goes on with the UVs of the nearest triangle. Two to four
    /// channels, as a redirection.
    UvSet(u32),
    /// As `UvSet`, minus the UV that the texel's own point of the surface has in that set: 0 where nothing moves.
    UvSetDelta(u32),
}

impl FetchKind {
    /// The default number of channels of an image of this kind.
    #[must_use]
    pub fn channels(self) -> u32 {
        *self.all_channels().start()
    }

    /// The numbers of channels that an image of this kind may have.
    fn all_channels(self) -> RangeInclusive<u32> {
        match self {
            FetchKind::Redirection | FetchKind::RedirectionDelta | FetchKind::RedirectionUdim => 2..=4,
            FetchKind::UvSet(_) | FetchKind::UvSetDelta(_) => 2..=4,
            FetchKind::Warp => 2..=3,
            FetchKind::Jacobian => 4..=4,
            FetchKind::FilterScale => 1..=1,
        }
    }

    /// Refuses a number of channels that an image of this kind cannot have; `name` is the image's.
    #[doc(hidden)]
    pub fn check_channels(self, name: impl Display, channels: u32) -> Result<()> {
        let all = self.all_channels();
        let (first, last) = (all.start(), all.end());
        let range = if first == last { format!("{first}") } else { format!("{first} to {last}") };
        ensure!(all.contains(&channels), "{name}: {channels} channels, but its kind has {range}");
        Ok(())
    }

    /// True for the forms of the redirection, which may have a fourth channel.
    pub(crate) fn is_redirection(self) -> bool {
        matches!(self, FetchKind::Redirection | FetchKind::RedirectionDelta | FetchKind::RedirectionUdim)
    }
}

/// Origin that a redirection's values are measured from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Form {
    /// The tile's corner (0, 0).
    Tile,
    /// The corner (0, 0) of tile 1001; the value is the tile's own corner.
    Udim(DVec2),
    /// The texel's centre.
    Delta,
}

impl Form {
    /// The form of this kind of output for a tile.
    pub fn new(kind: FetchKind, tile: &TileMesh) -> Form {
        match kind {
            FetchKind::RedirectionDelta => Form::Delta,
            FetchKind::RedirectionUdim => Form::Udim(tile.origin()),
            _ => Form::Tile,
        }
    }

    /// The value to write for a redirected UV within the tile, `delta` away from the texel's centre.
    #[inline(always)]
    pub fn value(self, uv: [f64; 2], delta: [f64; 2]) -> [f64; 2] {
        match self {
            Form::Tile => uv,
            Form::Udim(origin) => (DVec2::from(uv) + origin).into(),
            Form::Delta => delta,
        }
    }

    /// The corner that UVs are measured from, as whole numbers; `None` for offsets from the texel's centre.
    pub fn origin(self) -> Option<[u32; 2]> {
        match self {
            Form::Delta => None,
            Form::Tile => Some([0; 2]),
            Form::Udim(origin) => Some(origin.to_array().map(|x| x as u32)),
        }
    }

    /// The offset from the texel's centre to the redirected UV that a value stands for: the inverse of `value`.
    #[inline(always)]
    pub fn delta(self, value: DVec2, centre: DVec2) -> DVec2 {
        match self {
            Form::Tile => value - centre,
            Form::Udim(origin) => value - origin - centre,
            Form::Delta => value,
        }
    }
}

/// The smallest Jacobian at a corner of a quad of four neighbouring texels, 1 where nothing moves. The bilinear
/// interpolation between the texels is one-to-one if it is positive. `deltas` are the offsets in UV from the texels'
/// centres to the redirected UVs, beginning with the two at the quad's lower side; `size` is the map's size in texels.
pub(crate) fn smallest_jacobian(deltas: [DVec2; 4], size: DVec2) -> f64 {
    // The places of the texels, in texels.
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| DVec2::new((k % 2) as f64, (k / 2) as f64) + deltas[k] * size);
    let (left, right) = (c - a, d - b);
    let at_ends = |side: DVec2| side.perp_dot(left).min(side.perp_dot(right));
    let smallest = at_ends(b - a).min(at_ends(d - c));
    // Coarsely rounded neighbours may be equal: the rounding error of their distance must not count as a positive area.
    if smallest.abs() < 1e-11 { 0.0 } else { smallest }
}
