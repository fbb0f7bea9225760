//! Descriptions of a device, an asset and a tile, and the report of each solve.

use crate::settings::{AdapterId, Backend};

/// A report with these fields, and the others of another report or of `Default`. Outside of this crate a struct that may
/// grow has no expression.
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
    /// The backend in use, never `Auto`.
    pub backend: Backend,
    /// The processor's or adapter's name.
    pub name: String,
    /// Why this backend was chosen, in a sentence; if the GPU was lost since, also how.
    pub reason: String,
    /// CPU threads per solve.
    pub threads: u32,
    /// Bytes that the tiles of all assets of the device hold now.
    pub bytes_held: u64,
}

/// A GPU that a device could be made on.
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
    /// PCI vendor; 0 if the interface does not report it.
    pub vendor: u32,
    /// PCI device of that vendor; 0 if the interface does not report it.
    pub device: u32,
    /// Place on the PCI bus, `domain:bus:device.function`, hexadecimal; empty if the interface does not report it.
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
    /// Vertices in the position arrays.
    pub vertices: u64,
    /// Faces as given.
    pub faces: u64,
    /// Face corners as given: the length of a corner UV array.
    pub corners: u64,
    /// Number of UV sets. All following fields are totals over the sets.
    pub uv_sets: u32,
    /// Triangles kept, over all tiles.
    pub triangles: u64,
    /// Tiles with at least one triangle; each layer of a tile counts.
    pub tiles: u32,
    /// Charts, over all tiles.
    pub charts: u32,
    /// Triangles dropped because their UVs have no area.
    pub degenerate_triangles: u64,
    /// Faces kept although some of their UVs lie outside their tile; the map is clipped to the tile.
    pub clipped_faces: u64,
    /// Faces left out because their UV centroid lies in no UDIM tile (u < 0, u >= 10 or v < 0).
    pub faces_outside: u64,
    /// Faces without texture: without UVs, or not among the textured faces.
    pub faces_untextured: u64,
    /// Faces with fewer than three corners.
    pub faces_skipped: u64,
    /// Triangle sides at which a chart ends.
    pub border_edges: u64,
    /// Edges inside charts whose two sides have different vertices, welded by position.
    pub welded_edges: u64,
    /// Edges whose two sides coincide in position and UV, within the tolerances, but are not connected, so that charts
    /// end there. They are intended cuts; or the mesh needs [`crate::WeldBy::Position`]; or the noise of its UVs is large
    /// compared to its triangles.
    pub edges_apart: u64,
    /// Seams that are not an edge of any face and have no effect.
    pub seams_unused: u64,
}

/// Facts about a tile that need no solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct TileInfo {
    /// UDIM number: 1001 + U + 10 V.
    pub udim: u32,
    /// Charts in the tile.
    pub charts: u32,
    /// Triangles in the tile.
    pub triangles: u64,
    /// Cells of the grid in u and v.
    pub grid: [u32; 2],
    /// Nodes that may move.
    pub movable_nodes: u64,
    /// Fraction of the covered nodes that more than one layer covers.
    pub overlap: f32,
    /// The tile's UV set.
    pub uv_set: u32,
    /// Triangle sides at which a chart ends.
    pub border_edges: u64,
    /// Edges inside charts whose two sides have different vertices, welded by position.
    pub welded_edges: u64,
    /// Edges whose two sides coincide but are not connected: see [`AssetInfo::edges_apart`].
    pub edges_apart: u64,
    /// Fraction of the rigid texels that do not move: of the nodes under a triangle with a rigidity of at least 0.5, those
    /// that are fixed by a border, an overlap or the mask.
    pub frozen: f32,
    /// Which layer of its UDIM number the tile is ([`crate::MeshSource::max_layers`]).
    pub layer: u32,
    /// Number of layers of its UDIM number.
    pub layers: u32,
    /// Nodes under a triangle with a rigidity of at least 0.5.
    pub rigid_nodes: u64,
    /// How many of these lie under several triangles.
    pub rigid_overlapped: u64,
    /// Nodes inside charts that are fixed because of a gap in the UVs that welding closes ([`crate::Weld::uv_tolerance`]).
    pub gap_nodes: u64,
}

/// The memory that a tile needs, estimated before any is allocated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct TileEstimate {
    /// Nodes that may move.
    pub movable_nodes: u64,
    /// Bytes held once the tile is prepared: maps and grid.
    pub prepared_bytes: u64,
    /// Bytes at the peak of preparing it.
    pub preparing_bytes: u64,
    /// Bytes at the peak of a solve with [`crate::Solver::Descent`]. With a GPU this counts its memory and the host's.
    pub solving_bytes: u64,
}

/// Milliseconds per stage of one solve. On a GPU, the stages from surface to certify are measured on the GPU, and are 0
/// if it has no timestamps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct StageTimes {
    /// Positions to triangles and their metrics.
    pub surface: f32,
    /// Maps to grids (0 unless a map or setting changed).
    pub maps: f32,
    /// Pose metrics to all levels.
    pub pyramid: f32,
    /// Displacements to the next finer level.
    pub prolong: f32,
    /// Relaxation, node by node.
    pub relax: f32,
    /// Gauss-Newton corrections.
    pub correct: f32,
    /// The paper's solver.
    pub pbd: f32,
    /// The f64 certificate.
    pub certify: f32,
    /// Bringing charts together at seams.
    pub blend: f32,
    /// The latest inversion; not included in `total`.
    pub invert: f32,
    /// The whole solve of this tile, excluding measuring.
    pub total: f32,
}

/// Statistics of |strain|.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Strain {
    /// Root of the mean square.
    pub rms: f32,
    /// Median of the magnitudes.
    pub median: f32,
    /// 95th percentile.
    pub p95: f32,
    /// 99th percentile.
    pub p99: f32,
    /// Maximum.
    pub max: f32,
    /// RMS over edges within 10 cells of a chart border.
    pub border_rms: f32,
    /// RMS over the other edges.
    pub interior_rms: f32,
    /// RMS over the edges with two movable ends.
    pub free_rms: f32,
}

/// Strain on the mesh itself, over grid edges with rigidity over 0.5 at both ends. Edges with both ends fixed, by a
/// border, an overlap or the mask, are reported separately.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct StrainReport {
    /// Number of measured edges with at least one movable end: the fields down to `help` describe these.
    pub edges: u64,
    /// With the original UVs.
    pub before: Strain,
    /// With the warp.
    pub after: Strain,
    /// Fraction of edges whose |strain| rose by more than 0.25.
    pub harm: f32,
    /// Fraction of edges whose |strain| fell by more than 0.10.
    pub help: f32,
    /// Number of edges with both ends fixed.
    pub edges_fixed: u64,
    /// RMS of the |strain| of edges with both ends fixed, with and without the warp: no warp changes it.
    pub fixed: f32,
}

/// Report of a tile's last solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct TileReport {
    /// UDIM number.
    pub udim: u32,
    /// Cells of the grid in u and v.
    pub grid: [u32; 2],
    /// Energy of the identity, summed over the charts that were solved or reused, on the finest level that was worked on:
    /// level 1 for a draft, a coarser one if time was up there. It is 0, as is that of the result, if a time budget left no
    /// time to compute it.
    pub energy_before: f64,
    /// Energy of the result, on the same level.
    pub energy: f64,
    /// Smallest corner Jacobian of the result: > 0 certifies that the warp is one-to-one and onto. Computed in f64 on the
    /// CPU; on a GPU in f32 minus a bound of the rounding error, so that it never exceeds the true value.
    pub min_jacobian: f64,
    /// Corner Jacobians <= 0: always 0 from [`crate::Solver::Descent`].
    pub folds: u64,
    /// Length of the longest displacement, in cells.
    pub max_displacement: f32,
    /// Charts in the tile.
    pub charts: u32,
    /// Charts solved in this call.
    pub charts_active: u32,
    /// Charts that kept their last result because none of their inputs changed.
    pub charts_reused: u32,
    /// Charts that are the identity: nothing rigid, nothing movable, no extent at rest, or a pose isometric to rest.
    pub charts_identity: u32,
    /// Charts that fell back to the identity because nothing better was found.
    pub charts_fallback: u32,
    /// Charts that go on beyond seams and could not be brought together there with what their neighbours say, or not wholly,
    /// without crushing a cell.
    pub charts_apart: u32,
    /// Texels in charts whose redirection was limited in the latest image, or part of one: it would have led over the border of the chart into
    /// texture of another chart. 0 if charts do not go on beyond their borders.
    pub texels_limited: u64,
    /// By how much at most, in texels of that image.
    pub max_limit: f32,
    /// 16x16 blocks visited on the finest level.
    pub blocks_active: u64,
    /// 16x16 blocks of the whole tile.
    pub blocks: u64,
    /// Movable nodes of the solved charts, finest level.
    pub nodes_active: u64,
    /// Grid levels.
    pub levels: u32,
    /// Relaxation sweeps of the schedule, over all levels (excluding those after a partial step that was rejected);
    /// iterations of [`crate::Solver::Pbd`].
    pub sweeps: u32,
    /// Corrections of the schedule, over all levels; charts that gain too little skip the last ones.
    pub corrections: u32,
    /// Node updates by relaxation or iterations, over all levels. On a GPU this assumes that the whole schedule ran, and
    /// that each level has a quarter of the next finer one's nodes.
    pub node_updates: u64,
    /// Bytes held for this tile: maps, state, result.
    pub bytes: u64,
    /// True if the time budget ended the solve early.
    pub truncated: bool,
    /// Edges welded by position whose sides the pose pulls apart: charts end there in this result.
    pub welds_torn: u32,
    /// True if the last solve skipped the tile: it was frozen, not requested, or nothing in it had moved. The rest of the
    /// report then describes an earlier solve.
    pub kept: bool,
    /// Milliseconds per stage.
    pub times: StageTimes,
    /// Present if the solve was asked to measure.
    pub strain: Option<StrainReport>,
}

/// Report of an asset's last solve, over all tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct AssetReport {
    /// Tiles in the asset.
    pub tiles: u32,
    /// Tiles with at least one chart solved in the last call.
    pub tiles_active: u32,
    /// Charts solved, over all tiles.
    pub charts_active: u32,
    /// Charts reused, over all tiles.
    pub charts_reused: u32,
    /// Charts that are the identity, over all tiles.
    pub charts_identity: u32,
    /// Movable nodes of the solved charts.
    pub nodes_active: u64,
    /// Smallest corner Jacobian over all tiles.
    pub min_jacobian: f64,
    /// Corner Jacobians <= 0 over all tiles.
    pub folds: u64,
    /// Bytes held for the asset.
    pub bytes: u64,
    /// Wall-clock milliseconds of the last solve, excluding measuring.
    pub total_ms: f32,
    /// True if the time budget ended a tile's solve early.
    pub truncated: bool,
    /// Tiles that the last call skipped.
    pub tiles_kept: u32,
    /// The median stretch, length in the last pose as a multiple of the length at rest, of some thousand edges. Above 3
    /// or below 1/3, the log warns: the pose is most likely in other units, or its vertices in another order.
    pub median_stretch: f32,
    /// The share of these edges, 0..1, that are more than 3 times as long as at rest. Above 0.05, the log warns: the
    /// pose's vertices are most likely in another order than the mesh's.
    pub stretched_share: f32,
}

/// Dispatches, submissions and transfers of a tile's last solve on a GPU.
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
    pub kernels: Vec<GpuKernel>,
}

/// One kernel's share of a solve.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct GpuKernel {
    /// Its entry point and its parts of `shaders/`.
    pub name: String,
    /// How often it was dispatched.
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
