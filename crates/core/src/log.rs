//! The lines of a device's log. A program decides by their codes and values: the words are for people, and may change.

use std::sync::Arc;

/// A host's log function, called on the thread that called into vrtm. The asset that the line is about is in use
/// meanwhile.
pub type LogFn = Arc<dyn Fn(&LogEntry) + Send + Sync>;

/// Importance of a log line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LogLevel {
    /// Something to show to the artist: clipped faces, overlapping charts.
    Warning,
    /// Facts, such as the chosen device and the reason.
    Info,
}

/// Kind of a log line. Each has the same level and the same values in every line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum LogCode {
    /// A new device, and the reason for its choice. Values: CPU threads.
    Device,
    /// A new mesh. Values: vertices, faces, faces that are skipped, faces without texture, triangles, tiles.
    Mesh,
    /// A tile of a new mesh. Values: triangles, charts, border edges, edges welded by position, edges apart.
    Tile,
    /// Faces that reach out of their tile are clipped to it. Values: their number.
    FacesClipped,
    /// Faces that lie in no UDIM tile are left out. Values: their number.
    FacesOutside,
    /// Triangles without UV area are left out. Values: their number.
    TrianglesDegenerate,
    /// Edges lie together in space and nearly in UV, and are not connected, so that charts end there. Values: their
    /// number.
    EdgesApart,
    /// Seams that are no edge of a face do nothing. Values: their number.
    SeamsUnused,
    /// All rest positions are one point, so that nothing can move.
    RestIsPoint,
    /// A rigidity, of a tile or of the vertices, has values in another range than 0..1. Values: the largest.
    RigidityRange,
    /// A mask, of a tile or of the vertices, has values in another range than 0..1. Values: the largest.
    MaskRange,
    /// A grid that was set has too few cells for its rigid features. Values: cells in u and in v, cells per side that
    /// would resolve them.
    GridTooCoarse,
    /// A grid that was set has far more cells than its rigid features need. Values: as for the one that is too coarse.
    GridTooFine,
    /// Charts of a tile overlap, and what they share does not move in one map. Values: the share of the textured area.
    Overlap,
    /// Nodes are fixed at gaps in the UVs that welding closes. Values: their number.
    NodesAtGaps,
    /// A new grid. Values: nodes that may move, cells in u and in v, and of the rigid texels the shares that are fixed
    /// and overlapped, both 0 if nothing is rigid.
    Grid,
    /// A tile has rigid texels, but nothing that may move.
    NothingMoves,
    /// No tile has a rigidity, so that nothing moves.
    NoRigidity,
    /// A pose is only scaled, with [`crate::settings::Scale::Keep`], or its edges are much longer or shorter than at
    /// rest, as if it were in other units. Values: the median of their lengths, as multiples of those at rest. Told
    /// once for scaled poses that follow one another.
    PoseScale,
    /// Many edges of a pose are much longer than at rest, as if its vertices were in another order. Values: the share
    /// of edges over 3 times as long.
    PoseOrder,
    /// The pose tears welded edges of a tile. Values: torn edges, welded edges.
    WeldsTorn,
    /// The pose tears no welded edges of a tile any more. Values: 0, welded edges.
    WeldsWhole,
}

impl LogCode {
    fn level(self) -> LogLevel {
        match self {
            LogCode::Device
            | LogCode::Mesh
            | LogCode::Tile
            | LogCode::GridTooFine
            | LogCode::Grid
            | LogCode::WeldsWhole => LogLevel::Info,
            _ => LogLevel::Warning,
        }
    }
}

/// A line of the log.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct LogEntry<'a> {
    /// The importance.
    pub level: LogLevel,
    /// The kind.
    pub code: LogCode,
    /// UDIM number of the tile that the line is about; `None` = about no single tile.
    pub udim: Option<u32>,
    /// UV set of that tile; 0 without one.
    pub uv_set: u32,
    /// Layer of that tile; 0 without one.
    pub layer: u32,
    /// The numbers of the message, as the code lists them.
    pub values: &'a [f64],
    /// The line for people.
    pub message: &'a str,
}

impl<'a> LogEntry<'a> {
    /// `tile`: UDIM number, UV set and layer.
    #[doc(hidden)]
    #[must_use]
    pub fn new(code: LogCode, tile: Option<[u32; 3]>, values: &'a [f64], message: &'a str) -> LogEntry<'a> {
        let [udim, uv_set, layer] = tile.unwrap_or_default();
        let udim = (udim > 0).then_some(udim);
        LogEntry { level: code.level(), code, udim, uv_set, layer, values, message }
    }
}
