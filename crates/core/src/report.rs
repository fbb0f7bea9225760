//! Descriptions of a device, an asset and a tile, and the report of each solve.

use crate::settings::{AdapterId, Backend};

/// A report with these fields, and the others of another report or of `Default`. Outside of this crate a struct that
/// may grow has no expression.
#[doc(hidden)]
#[macro_export]
macro_rules! report {
    ($report:ident { $($field:ident: $value:expr),+ $(,)? }) => {
        $crate::report!($report::default(), { $($field: $value),+ })
    };
    ($others:expr, { $($field:ident: $value:expr),+ $(,)? }) => {{
        let mut report = $others;
        $(report.$field = $value;)+
        report
    }};
}
pub use report;

/// Description of a device.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct DeviceInfo {
    /// The backend in use: [`Backend::Cpu`] or [`Backend::Gpu`].
    pub backend: Backend,
    /// The processor's or adapter's name.
    pub name: String,
    /// Reason for the choice of this backend, a sentence; if the GPU was lost since, also the cause.
    pub reason: String,
    /// CPU threads per solve.
    pub threads: u32,
    /// Bytes that the prepared tiles of all assets of the device hold now, with their maps and solvers.
    pub bytes_held: u64,
}

/// A GPU that a device can be made on.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct AdapterInfo {
    /// The adapter's name.
    pub name: String,
    /// The driver's name and version.
    pub driver: String,
    /// The graphics interface in use: Vulkan, Direct3D 12 or Metal.
    pub api: &'static str,
    /// True for an adapter that is emulated on the CPU: [`Backend::Auto`] never takes it.
    pub software: bool,
    /// `VkPhysicalDeviceIDProperties::deviceUUID`; `None` for an adapter of another interface than Vulkan.
    pub uuid: Option<[u8; 16]>,
    /// `VkPhysicalDeviceIDProperties::driverUUID`: memory can be shared between two programs if this and `uuid` are the
    /// same in both.
    pub driver_uuid: Option<[u8; 16]>,
    /// The LUID of Direct3D and DXGI, in memory order: on Windows, also for Vulkan adapters.
    pub luid: Option<[u8; 8]>,
    /// `MTLDevice.registryID`.
    pub registry_id: Option<u64>,
    /// PCI vendor ID; 0 if the interface does not report it.
    pub vendor: u32,
    /// PCI device ID of the vendor; 0 if the interface does not report it.
    pub device: u32,
    /// Place on the PCI bus, domain:bus:device.function, hexadecimal; empty if the interface does not report it.
    pub pci_bus: String,
}

impl AdapterInfo {
    /// True if `id` identifies this adapter.
    #[must_use]
    pub fn has_id(&self, id: AdapterId) -> bool {
        match id {
            AdapterId::Uuid(uuid) => self.uuid == Some(uuid),
            AdapterId::Luid(luid) => self.luid == Some(luid),
            AdapterId::Registry(number) => self.registry_id == Some(number),
        }
    }

    /// Every identity by which this adapter can be requested.
    pub fn ids(&self) -> impl Iterator<Item = AdapterId> {
        let registry = self.registry_id.map(AdapterId::Registry);
        [self.uuid.map(AdapterId::Uuid), self.luid.map(AdapterId::Luid), registry].into_iter().flatten()
    }
}

/// Description of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct AssetInfo {
    /// Vertices: the length of every array of positions.
    pub vertices: u64,
    /// Faces as given.
    pub faces: u64,
    /// Corners as given: the length of an array of corner UVs.
    pub corners: u64,
    /// UV sets, 1 or more. All counts that concern UVs are sums over the sets.
    pub uv_sets: u32,
    /// Triangles kept, over all tiles.
    pub triangles: u64,
    /// Tiles with at least one triangle; each layer of a tile counts.
    pub tiles: u32,
    /// Charts, over all tiles.
    pub charts: u32,
    /// Triangles dropped because their UVs have no area.
    pub degenerate_triangles: u64,
    /// Faces with UVs outside their tile; the map is clipped to the tile.
    pub clipped_faces: u64,
    /// Faces left out because their UV centroid lies in no UDIM tile (u < 0, u >= 10 or v < 0).
    pub faces_outside: u64,
    /// Untextured faces: without UVs, or not among the textured faces.
    pub faces_untextured: u64,
    /// Faces skipped because they have fewer than 3 corners.
    pub faces_skipped: u64,
    /// Sides of triangles at which a chart ends.
    pub border_edges: u64,
    /// Edges inside charts whose two sides have different vertices: welded by position.
    pub welded_edges: u64,
    /// Edges whose two sides have the same positions and nearly the same UVs, but are not connected: charts end there.
    /// Nearly means within four times the tolerance of UVs, and a quarter of the triangles' least height. Either they
    /// are deliberate cuts, or the mesh needs [`crate::mesh::WeldBy::Position`], or its UVs are noisy compared with the
    /// size of its triangles.
    pub edges_apart: u64,
    /// Seams that are not an edge of any face.
    pub seams_unused: u64,
}

/// Facts about a tile that need no solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct TileInfo {
    /// UDIM number: 1001 + U + 10 V.
    pub udim: u32,
    /// Charts in the tile: connected pieces of UV triangles.
    pub charts: u32,
    /// Triangles in the tile.
    pub triangles: u64,
    /// Cells of the grid in u and v. A grid of w x h cells has (w + 1) x (h + 1) nodes.
    pub grid: [u32; 2],
    /// Nodes of the grid that may move.
    pub movable_nodes: u64,
    /// Fraction (0..1) of the covered nodes that more than one layer of triangles covers.
    pub overlap: f32,
    /// The UV set that the tile belongs to.
    pub uv_set: u32,
    /// Sides of triangles at which a chart ends.
    pub border_edges: u64,
    /// Edges inside charts whose two sides have different vertices: welded by position.
    pub welded_edges: u64,
    /// Edges whose two sides nearly coincide but are not connected: see [`AssetInfo::edges_apart`].
    pub edges_apart: u64,
    /// Fraction (0..1) of the rigid nodes that cannot move: of the covered nodes with a rigidity of at least 0.5, those
    /// that a border, an overlap or the mask fixes. Near 1, the rigidity map can have almost no effect.
    pub fixed: f32,
    /// The tile's layer within its UDIM number: 0 unless [`crate::mesh::MeshSource::max_layers`] is over 1.
    pub layer: u32,
    /// Layers of its UDIM number: 1 or more.
    pub layers: u32,
    /// Rigid nodes: covered nodes with a rigidity of at least 0.5.
    pub rigid_nodes: u64,
    /// Number of these under more than one triangle, as in charts of one layer that lie over one another.
    pub rigid_overlapped: u64,
    /// Nodes inside charts that cannot move because of a gap in the UVs that welding closes, such as a slit narrower
    /// than [`crate::mesh::Weld::uv_tolerance`]. Noise of the UVs makes none.
    pub gap_nodes: u64,
}

/// The predicted cost of preparing and solving a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct TileEstimate {
    /// Nodes of the grid that may move: time and memory grow with their number.
    pub movable_nodes: u64,
    /// Bytes held once the tile is prepared: maps and grid.
    pub prepared_bytes: u64,
    /// Bytes at the peak of preparing it.
    pub preparing_bytes: u64,
    /// Bytes at the peak of a solve with [`crate::settings::Solver::Descent`]. With a GPU this counts its memory and
    /// the host's.
    pub solving_bytes: u64,
}

/// Milliseconds per stage of one solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct StageTimes {
    /// Milliseconds: positions to triangles and their metrics. The times of stages are measured on the device; on a GPU
    /// without timestamps they are 0, and only the total is known.
    pub surface: f32,
    /// Milliseconds: maps to grids; 0 unless a map or a setting changed.
    pub maps: f32,
    /// Milliseconds: pose metrics to all levels.
    pub pyramid: f32,
    /// Milliseconds: displacements to the next finer level.
    pub prolong: f32,
    /// Milliseconds: relaxation, node by node.
    pub relax: f32,
    /// Milliseconds: Gauss-Newton corrections.
    pub correct: f32,
    /// Milliseconds: iterations of [`crate::settings::Solver::Pbd`].
    pub pbd: f32,
    /// Milliseconds: the certificate.
    pub certify: f32,
    /// Milliseconds: bringing charts together at seams.
    pub blend: f32,
    /// Milliseconds: the latest inversion of the warp; not part of the total.
    pub invert: f32,
    /// Milliseconds: the whole solve of this tile, without measuring strain.
    pub total: f32,
}

/// Statistics of strain: deformed length over rest length, minus 1, of segments that are fixed in the texture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Strain {
    /// Root of the mean square.
    pub rms: f32,
    /// Median of the magnitudes.
    pub median: f32,
    /// 95th percentile of the magnitudes.
    pub p95: f32,
    /// 99th percentile of the magnitudes.
    pub p99: f32,
    /// Largest magnitude.
    pub max: f32,
    /// RMS over segments within 10 cells of a chart's border, which cannot move.
    pub border_rms: f32,
    /// RMS over the other segments.
    pub interior_rms: f32,
    /// RMS over the segments with two movable ends.
    pub free_rms: f32,
}

/// A painted feature that is worse than without the warp: its error rose by more than 0.02.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct WorstFeature {
    /// Centre in u and v, among all tiles: the mean over its nodes.
    pub uv: [f32; 2],
    /// Area in UV units: that of the tile is 1.
    pub area: f32,
    /// RMS strain of its segments with the mesh's own UVs.
    pub before: f32,
    /// RMS strain of its segments with the warp.
    pub after: f32,
    /// True if a chart's border, a seam or an open one, touches it.
    pub at_border: bool,
}

/// Strain on the mesh itself, of segments between neighbouring nodes whose rigidity is over half of the tile's largest
/// at both ends. `fixed` and `segments_fixed` cover the segments that a border, an overlap or the mask fixes at both
/// ends. A feature is a connected set of such nodes of one chart with at least 12 segments, of both kinds; its error is
/// the RMS strain of these. All other fields cover the segments that are not fixed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct StrainReport {
    /// Segments that are not fixed at both ends.
    pub segments: u64,
    /// Strain with the mesh's own UVs.
    pub before: Strain,
    /// Strain with the warp.
    pub after: Strain,
    /// Fraction (0..1) of the segments whose strain rose by more than 0.25.
    pub harm: f32,
    /// Fraction of the segments whose strain fell by more than 0.10.
    pub help: f32,
    /// Segments that are fixed at both ends.
    pub segments_fixed: u64,
    /// RMS strain of the segments that are fixed at both ends; the warp does not change it. The mean square over
    /// all rigid segments is that of both kinds, weighted by `segments` and `segments_fixed`.
    pub fixed: f32,
    /// Painted features.
    pub features: u32,
    /// Painted features that are worse than without the warp: their error rose by more than 0.02.
    pub features_worse: u32,
    /// Painted features whose error is over 0.05 with the mesh's own UVs.
    pub features_strained_before: u32,
    /// Painted features whose error is over 0.05 with the warp.
    pub features_strained_after: u32,
    pub(crate) worst: [WorstFeature; 16],
}

impl StrainReport {
    /// The features that are worse than without the warp, those whose error rose most first: at most 16.
    #[must_use]
    pub fn worst(&self) -> &[WorstFeature] {
        &self.worst[..self.worst.len().min(self.features_worse as usize)]
    }
}

/// A tile's last solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct TileReport {
    /// UDIM number: 1001 + U + 10 V.
    pub udim: u32,
    /// Cells of the grid in u and v.
    pub grid: [u32; 2],
    /// Energy of the identity, summed over the charts that were solved or reused, on the finest level that was worked
    /// on: level 1 for a draft, a coarser one if time was up there.
    pub energy_before: f64,
    /// Energy of the result, on the same level.
    pub energy: f64,
    /// Smallest corner Jacobian of the result (1 at rest), computed in double precision (on a GPU in single precision
    /// minus a bound of the rounding error, so never too large): greater than 0 certifies that the warp is one-to-one
    /// and onto.
    pub min_jacobian: f64,
    /// Corner Jacobians that are not greater than 0: always 0 from [`crate::settings::Solver::Descent`].
    pub folds: u64,
    /// Length of the longest displacement, in cells.
    pub max_displacement: f32,
    /// Charts in the tile.
    pub charts: u32,
    /// Charts solved in this call.
    pub charts_active: u32,
    /// Charts that kept their last result because none of their inputs changed.
    pub charts_reused: u32,
    /// Charts whose warp is the identity: nothing rigid, nothing movable, no extent at rest, or deformed without
    /// strain.
    pub charts_identity: u32,
    /// Charts that fell back to the identity because nothing better was found.
    pub charts_fallback: u32,
    /// With [`crate::settings::Seams::Continue`]: charts that do not fully agree with their neighbours at seams,
    /// because a cell would be crushed.
    pub charts_apart: u32,
    /// With [`crate::settings::Seams::Continue`] or [`crate::settings::OpenBorders::Slide`]: texels in charts whose
    /// redirection was limited in the latest image, or part of one, since it would have led over the border of the
    /// chart into texture of another chart.
    pub texels_limited: u64,
    /// By how much at most, in texels of that image.
    pub max_limit: f32,
    /// Blocks of 16 x 16 nodes that were visited on the finest level.
    pub blocks_active: u64,
    /// All blocks of the tile.
    pub blocks: u64,
    /// Movable nodes of the solved charts on the finest level.
    pub nodes_active: u64,
    /// Levels of the grid that the solver works on.
    pub levels: u32,
    /// Relaxation sweeps of the schedule, or iterations of [`crate::settings::Solver::Pbd`], over all levels (without
    /// those after a partial step that was rejected).
    pub sweeps: u32,
    /// Gauss-Newton corrections of the schedule, over all levels; charts that gain too little skip the last ones.
    pub corrections: u32,
    /// Node updates by relaxation sweeps or iterations, over all levels. On a GPU this assumes that the whole schedule
    /// ran, and that each level has a quarter of the next finer one's nodes.
    pub node_updates: u64,
    /// Bytes held for this tile: maps, state, result.
    pub bytes: u64,
    /// True if the time budget ended the solve early, or left no time for the tile.
    pub truncated: bool,
    /// Edges welded by position whose sides the pose pulls apart: charts end there in this result.
    pub welds_torn: u32,
    /// True if the asset's last solve left the tile as it was: it was frozen, not requested, or touched by no dirty
    /// vertex, or the time budget left no time for it (then it is `truncated`, too). The other fields then describe the
    /// tile's own last solve.
    pub kept: bool,
    /// Milliseconds per stage.
    pub times: StageTimes,
    /// Present if the solve was asked to measure.
    pub strain: Option<StrainReport>,
}

/// An asset's last solve, over all tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct AssetReport {
    /// Tiles in the asset.
    pub tiles: u32,
    /// Tiles with at least one chart solved in the last call.
    pub tiles_active: u32,
    /// Charts solved.
    pub charts_active: u32,
    /// Charts that kept their last result because none of their inputs changed.
    pub charts_reused: u32,
    /// Charts whose warp is the identity.
    pub charts_identity: u32,
    /// Movable nodes of the solved charts.
    pub nodes_active: u64,
    /// Smallest corner Jacobian over all tiles: greater than 0 certifies that no warp folds.
    pub min_jacobian: f64,
    /// Corner Jacobians that are not greater than 0: always 0 from [`crate::settings::Solver::Descent`].
    pub folds: u64,
    /// Bytes held for the asset.
    pub bytes: u64,
    /// Wall-clock milliseconds of the last solve, without measuring strain.
    pub total_ms: f32,
    /// True if the time budget ended a tile's solve early, or left no time for it.
    pub truncated: bool,
    /// Tiles with a result that the last call left as it was: frozen, not requested, touched by no dirty vertex, or
    /// without time. Their charts count as reused.
    pub tiles_kept: u32,
    /// Median ratio of posed length to rest length, over a few thousand edges, which
    /// [`crate::settings::Scale::Follow`] multiplies the rest lengths by. Without that, the log warns if it is over 3
    /// or under 1/3: the pose probably has other units, or its vertices are in another order.
    pub scale: f32,
    /// Share (0..1) of these edges that are more than 3 times as long as at rest (with
    /// [`crate::settings::Scale::Follow`]: times `scale`). If it is over 0.05, the log warns: the pose's vertices are
    /// probably in another order than the mesh's.
    pub stretched_share: f32,
    /// Spread of these ratios: 95 % of them are within this fraction of `scale` from it. Under 0.001 all edges share
    /// one factor, and the pose is the mesh at another size, moved or bent.
    pub scale_spread: f32,
}

/// Dispatches, submissions and transfers of a tile's last solve on a GPU. Tiles that were solved together have the
/// same.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct GpuWork {
    /// Milliseconds on the host until positions and lists were uploaded, ...
    pub upload_ms: f32,
    /// ... until all commands were recorded and submitted, ...
    pub record_ms: f32,
    /// ... and until the GPU was done and the outcome was read.
    pub wait_ms: f32,
    /// Milliseconds on the GPU, all stages; `None` if it has no timestamps.
    pub gpu_ms: Option<f32>,
    /// Command submissions.
    pub submissions: u64,
    /// Dispatches that turned out empty: trials and rounds of the step limit that no chart needed.
    pub skipped: u64,
    /// Dispatches, including empty ones, that had to wait until all earlier ones were done.
    pub barriers: u64,
    /// Bytes of the tile's buffers on the GPU: those of its solver, and two results.
    pub bytes_held: u64,
    /// The kernels that ran.
    #[expect(clippy::disallowed_types, reason = "public: that of the standard library")]
    pub kernels: std::vec::Vec<GpuKernel>,
}

/// One kernel's share of a solve.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct GpuKernel {
    /// Its entry point and its parts of `shaders/`.
    pub name: String,
    /// Number of its dispatches.
    pub dispatches: u64,
    /// Its workgroups: 16x16 blocks, for most kernels.
    pub workgroups: u64,
    /// Minimum bytes moved, each datum counted once per dispatch, without charts that skip a correction.
    pub bytes: u64,
    /// Milliseconds on the GPU; `None` unless kernels are timed separately.
    pub ms: Option<f32>,
}

impl GpuWork {
    /// Dispatches of all kernels.
    #[must_use]
    pub fn dispatches(&self) -> u64 {
        self.kernels.iter().map(|kernel| kernel.dispatches).sum()
    }

    /// Total over all kernels.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.kernels.iter().map(|kernel| kernel.bytes).sum()
    }
}
