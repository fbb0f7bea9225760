//! Descriptions of a device, an asset and a tile, and the report of each solve.

use crate::settings::{AdapterId, Backend};

/// Description of a device.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DeviceInfo {
    /// The backend in use, never `Auto`.
    pub backend: Backend,
    /// The processor's or adapter's name.
    pub name: String,
    /// Why this backend was chosen, in a sentence; and if the GPU went away since, how.
    pub reason: String,
    /// CPU threads per solve.
    pub threads: u32,
    /// Bytes that the tiles of all assets of the device hold now.
    pub bytes_held: u64,
}

/// A GPU that a device could be made on.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct AdapterInfo {
    /// The adapter's name.
    pub name: String,
    /// The driver's name and version.
    pub driver: String,
    /// The graphics interface it is driven through: Vulkan, Direct3D 12 or Metal.
    pub api: &'static str,
    /// True for an adapter that is emulated on the CPU: [`Backend::Auto`] never takes it.
    pub software: bool,
    /// `VkPhysicalDeviceIDProperties::deviceUUID`; `None` where it is driven through another interface.
    pub uuid: Option<[u8; 16]>,
    /// `VkPhysicalDeviceIDProperties::driverUUID`: memory goes from one program to another where this and `uuid` are the
    /// same for both.
    pub driver_uuid: Option<[u8; 16]>,
    /// The LUID of Direct3D and DXGI, in memory order: on Windows, also through Vulkan.
    pub luid: Option<[u8; 8]>,
    /// `MTLDevice.registryID`.
    pub registry_id: Option<u64>,
    /// PCI vendor; 0 where the interface does not tell.
    pub vendor: u32,
    /// PCI device of that vendor; 0 where the interface does not tell.
    pub device: u32,
    /// Place on the PCI bus, `domain:bus:device.function`, hexadecimal; empty where the interface does not tell.
    pub pci_bus: String,
}

impl AdapterInfo {
    /// Whether this is the adapter that is meant.
    #[must_use]
    pub fn has_id(&self, id: AdapterId) -> bool {
        match id {
            AdapterId::Uuid(uuid) => self.uuid == Some(uuid),
            AdapterId::Luid(luid) => self.luid == Some(luid),
            AdapterId::Registry(number) => self.registry_id == Some(number),
        }
    }

    /// All that it can be asked for by.
    pub(crate) fn ids(&self) -> impl Iterator<Item = AdapterId> {
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
    /// UV sets. All that follows is counted over all of them.
    pub uv_sets: u32,
    /// Triangles kept, over all tiles.
    pub triangles: u64,
    /// Tiles with at least one triangle.
    pub tiles: u32,
    /// Charts, over all tiles.
    pub charts: u32,
    /// Triangles dropped because their UVs have no area.
    pub degenerate_triangles: u64,
    /// Faces kept although some of their UVs lie outside their tile; the map is clipped to the tile.
    pub clipped_faces: u64,
    /// Faces left out because their UV centroid lies in no UDIM tile (u < 0, u >= 10 or v < 0).
    pub faces_outside: u64,
    /// Faces without texture: without UVs, or not among the faces that were chosen.
    pub faces_untextured: u64,
    /// Faces with fewer than three corners.
    pub faces_skipped: u64,
    /// Sides of triangles at which a chart ends.
    pub border_edges: u64,
    /// Edges inside charts whose two sides have different vertices, welded by position.
    pub welded_edges: u64,
    /// Edges whose two sides have the same positions and UVs, up to the tolerances, and are not connected: charts end
    /// there. They are cuts; or the mesh wants [`crate::WeldBy::Position`]; or the noise of its UVs is large against
    /// its triangles.
    pub edges_apart: u64,
    /// Seams that are no edge of a face, and do nothing.
    pub seams_unused: u64,
}

/// Facts of a tile that need no solve.
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
    /// The UV set that it belongs to.
    pub uv_set: u32,
    /// Sides of triangles at which a chart ends.
    pub border_edges: u64,
    /// Edges inside charts whose two sides have different vertices, welded by position.
    pub welded_edges: u64,
    /// Edges whose two sides lie together and are not connected: see [`AssetInfo::edges_apart`].
    pub edges_apart: u64,
    /// Fraction of the rigid texels that do not move: of the nodes under a triangle with a rigidity of at least 0.5, those
    /// that are fixed by a border, an overlap or the mask.
    pub frozen: f32,
}

/// What a tile takes, before any of it is taken.
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

/// Milliseconds per stage of one solve. On a GPU those of surface to certify are measured there, and 0 where it has no
/// timestamps.
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
    /// The latest inversion; its time is not in `total`.
    pub invert: f32,
    /// The whole solve of this tile, less measuring.
    pub total: f32,
}

/// One distribution of |strain|.
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
    /// Largest.
    pub max: f32,
    /// RMS over edges within 10 cells of a chart border.
    pub border_rms: f32,
    /// RMS over the other edges.
    pub interior_rms: f32,
    /// RMS over the edges of which both ends may move.
    pub free_rms: f32,
}

/// Strain on the mesh itself, over grid edges with rigidity over 0.5 at both ends. Those that are fixed at both ends, by a
/// border, an overlap or the mask, stand apart from the others.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct StrainReport {
    /// How many edges with an end that may move were measured: the figures down to `help` are theirs.
    pub edges: u64,
    /// With the original UVs.
    pub before: Strain,
    /// With the warp.
    pub after: Strain,
    /// Fraction of edges whose |strain| rose by more than 0.25.
    pub harm: f32,
    /// Fraction of edges whose |strain| fell by more than 0.10.
    pub help: f32,
    /// How many edges are fixed at both ends.
    pub edges_fixed: u64,
    /// RMS of their |strain|, with the warp and without: no warp changes it.
    pub fixed: f32,
}

/// A tile's last solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct TileReport {
    /// UDIM number.
    pub udim: u32,
    /// Cells of the grid in u and v.
    pub grid: [u32; 2],
    /// Energy of the identity, summed over the charts that were solved or reused; 0, as that of the result, where a time
    /// budget left no time to compute it.
    pub energy_before: f64,
    /// Energy of the result.
    pub energy: f64,
    /// Smallest corner Jacobian of the result: > 0 certifies that the warp is one-to-one and onto. In f64 on the CPU;
    /// on a GPU in f32 less a bound of the rounding, so that it is never more than the true one.
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
    /// 16x16 blocks visited on the finest level.
    pub blocks_active: u64,
    /// 16x16 blocks of the whole tile.
    pub blocks: u64,
    /// Movable nodes of the solved charts, finest level.
    pub nodes_active: u64,
    /// Grid levels.
    pub levels: u32,
    /// Relaxation sweeps of the schedule, over all levels (not those after parts of a step that were refused);
    /// iterations of [`crate::Solver::Pbd`].
    pub sweeps: u32,
    /// Corrections of the schedule, over all levels; charts that gain too little sit out the last ones.
    pub corrections: u32,
    /// Node updates by relaxation or iterations, over all levels; on a GPU as if every part of the schedule ran, and a
    /// level had a quarter of the next finer one's nodes.
    pub node_updates: u64,
    /// Bytes held for this tile: maps, state, result.
    pub bytes: u64,
    /// True if the time budget ended the solve early.
    pub truncated: bool,
    /// Edges welded by position whose sides the pose pulls apart: charts end there in this result.
    pub welds_torn: u32,
    /// Whether the last solve left the tile alone: it was frozen, not asked for, or nothing of it had moved. The rest of the
    /// report is then of an earlier solve.
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
    /// Wall-clock milliseconds of the last solve, less measuring.
    pub total_ms: f32,
    /// True if the time budget ended a tile's solve early.
    pub truncated: bool,
    /// Tiles that the last call left alone.
    pub tiles_kept: u32,
    /// The median, over some thousand edges of the last pose, of their length as a multiple of that at rest. Over 3 or
    /// under 1/3, which the log warns of, the pose is most likely in other units, or its vertices in another order.
    pub median_stretch: f32,
    /// The share of these edges, 0..1, that are more than 3 times as long as at rest. Over 0.05, which the log warns of,
    /// the pose's vertices are most likely in another order than the mesh's.
    pub stretched_share: f32,
}

/// Dispatches, submissions and transfers of a tile's last solve on a GPU.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct GpuWork {
    /// Milliseconds on the host until positions and lists were handed over, ...
    pub upload_ms: f32,
    /// ... until all commands were recorded and submitted, ...
    pub record_ms: f32,
    /// ... and until the GPU was done and the outcome read.
    pub wait_ms: f32,
    /// Milliseconds on the GPU, all stages; `None` where it has no timestamps.
    pub gpu_ms: Option<f32>,
    /// Command submissions.
    pub submissions: u64,
    /// Dispatches that turned out empty: trials and rounds of the step limit that no chart needed.
    pub skipped: u64,
    /// Dispatches, empty ones included, that had to wait until those before them were done.
    pub barriers: u64,
    /// Bytes of the tile's buffers on the GPU: its solver's, and two results.
    pub bytes_held: u64,
    /// The kernels that ran.
    pub kernels: Vec<GpuKernel>,
}

/// One kernel's part of a solve.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct GpuKernel {
    /// Its entry point, and its parts of `shaders/`.
    pub name: String,
    /// How often it was dispatched.
    pub dispatches: u64,
    /// Its workgroups: 16x16 blocks, for most kernels.
    pub workgroups: u64,
    /// Bytes that these move at least, each datum counted once per dispatch, without charts that sit a correction out.
    pub bytes: u64,
    /// Milliseconds on the GPU; `None` unless kernels are timed one by one.
    pub ms: Option<f32>,
}

impl GpuWork {
    /// Of all kernels.
    #[must_use]
    pub fn dispatches(&self) -> u64 {
        self.kernels.iter().map(|kernel| kernel.dispatches).sum()
    }

    /// Of all kernels.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.kernels.iter().map(|kernel| kernel.bytes).sum()
    }
}
