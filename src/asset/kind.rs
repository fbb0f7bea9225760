//! What can be fetched of a result.

use std::fmt::Display;
use std::ops::RangeInclusive;

use crate::error::{Error, Result};

/// The content of a fetched image, f32 or f16. UVs have two channels (u, v); an image may have a third one, which is 0, and
/// a redirection a fourth, which is 1 where a chart covers the texel's centre and 0 elsewhere: programs that know colours take
/// two channels for luminance and alpha.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FetchKind {
    /// Inverse warp at texel centres, absolute within the tile (0..1). f16 holds less than a texel from 1024 on.
    Redirection,
    /// The same less the texel centre itself, in UV.
    RedirectionDelta,
    /// The warp itself, absolute within the tile, from border to border: (nx+1) x (ny+1) texels give the nodes exactly.
    /// At any other size each cell is two triangles, split by its diagonal from (0,0) to (1,1), and the warp is affine on
    /// each: what the redirection inverts. Nodes of [`crate::Solver::Pbd`] may lie a little outside of the tile.
    Warp,
    /// The redirection plus the tile's offset (U, V): absolute among all tiles, as the mesh's own UVs are.
    RedirectionUdim,
    /// Derivatives of the redirection (u', v') by the UV at texel centres, four channels: du'/du, du'/dv, dv'/du, dv'/dv.
    Jacobian,
    /// Largest singular value of that, one channel: how many times wider a lookup's footprint is in the texture than on the
    /// surface.
    FilterScale,
}

impl FetchKind {
    /// Channels that an image of this kind has if nothing else is asked for.
    #[must_use]
    pub fn channels(self) -> u32 {
        *self.all_channels().start()
    }

    /// Channels that an image of this kind may have.
    fn all_channels(self) -> RangeInclusive<u32> {
        match self {
            FetchKind::Redirection | FetchKind::RedirectionDelta | FetchKind::RedirectionUdim => 2..=4,
            FetchKind::Warp => 2..=3,
            FetchKind::Jacobian => 4..=4,
            FetchKind::FilterScale => 1..=1,
        }
    }

    /// # Errors
    /// `InvalidArgument`, naming `name`, unless an image of this kind may have so many channels.
    pub(crate) fn check_channels(self, name: impl Display, channels: u32) -> Result<()> {
        let all = self.all_channels();
        if all.contains(&channels) {
            return Ok(());
        }
        let (first, last) = (all.start(), all.end());
        let range = if first == last { format!("{first}") } else { format!("{first} to {last}") };
        Err(Error::argument(format!("{name}: {channels} channels, but {self:?} has {range}")))
    }

    /// Whether it is one of the redirection's forms, which may have a fourth channel.
    pub(crate) fn is_redirection(self) -> bool {
        matches!(self, FetchKind::Redirection | FetchKind::RedirectionDelta | FetchKind::RedirectionUdim)
    }
}
