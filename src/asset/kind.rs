//! What can be fetched of a result.

/// The content of a fetched image: two channels (u, v) per texel, f32 or f16.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FetchKind {
    /// Inverse warp at texel centres, absolute within the tile (0..1). f16 holds less than a texel from 1024 on.
    Redirection,
    /// The same less the texel centre itself, in UV.
    RedirectionDelta,
    /// The warp itself, absolute within the tile, from border to border: (nx+1) x (ny+1) texels give the nodes exactly.
    /// At any other size each cell is two triangles, split by its diagonal from (0,0) to (1,1), and the warp is affine on
    /// each: what the redirection inverts.
    Warp,
}
