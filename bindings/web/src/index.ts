/**
 * Variable rigidity texture mapping: given a mesh at rest, its UVs, a map of what is rigid, and a pose, `Asset` finds
 * where each texel has to be looked up so that painted features keep their shape. Everything runs on the CPU, in
 * WebAssembly, on the thread that calls: pages use `WorkerAsset` of "vrtm/worker", which has the same methods.
 */
import { AssetMethods, VrtmError, tell } from "./methods.js";
import { guarded, module, type Module } from "./module.js";

export { Carrier, AssetMethods, VrtmError, type Code } from "./methods.js";
export { load } from "./module.js";
export { Surface, rigidity, type Dab, type Picture, type SurfaceHit } from "./paint.js";

/** Positions or UVs, one after the other. */
export type Numbers = Float32Array | Float64Array;
/** Texels of one channel: 0..255, 0..65535 or 0..1. The first row is v = 1, as in image files. */
export type Texels = Uint8Array | Uint8ClampedArray | Uint16Array | Float32Array;

/** A mesh at rest. */
export interface Mesh {
  /** Three numbers per vertex. */
  positions: Numbers;
  /** Corners of each face; without it all faces are triangles. */
  faceCounts?: Uint32Array;
  /** Vertex of each face corner. */
  indices: Uint32Array;
  /** Two numbers per UV; v points up. A tile is 1001 + floor(u) + 10 floor(v). */
  uvs: Numbers;
  /** UV of each face corner; without it there is one UV per corner. */
  uvIndices?: Uint32Array;
  /** Further UV sets, from set 1 on. Each has its own tiles, after those of the set before it. */
  uvSets?: { uvs: Numbers; uvIndices?: Uint32Array }[];
  /** Vertices at the same place are one, as in meshes of games. */
  weldByPosition?: boolean;
  /** Most layers of a tile: charts that lie over others get maps of their own. */
  maxLayers?: number;
}

/** Settings of a tile; those left out keep their values. docs/settings.md has limits and defaults. */
export interface Settings {
  /** Cells of the grid along each side; 0 = as many as the rigid features need. */
  grid?: number;
  overlap?: "fixed" | "firstFace";
  smoothness?: number;
  smoothnessFloor?: number;
  orientation?: number;
  orientationDensity?: number;
  room?: number;
  roomThreshold?: number;
  seams?: "shut" | "continue" | "keep";
  seamReach?: number;
  openBorders?: "fixed" | "slide";
  harm?: number;
}

/** Options of a solve. */
export interface Options {
  /** Amount of work: `draft` while something moves, `normal` (the default) when it rests. */
  quality?: "draft" | "normal";
  solver?: "descent" | "pbd";
  /** `keep` (the default): features have their size at rest. `follow`: rest lengths are multiplied by the pose's own
   * `Redirected.scale`, for a character under a scale control. */
  scale?: "keep" | "follow";
  /** Milliseconds that the solve may take. */
  timeBudget?: number;
  maxCorrections?: number;
  tolerance?: number;
  /** Start from the last result: quicker, but the result depends on the order of frames. */
  warm?: boolean;
  temporalWeight?: number;
  /** Measure the strain on the mesh for the reports. Slow. */
  measure?: boolean;
  /** The newest pose wins, the default: a `redirect` of a `WorkerAsset` that waits for its turn is replaced by the next
   * one. `false`: it is solved in any case, as `solve` is, and all calls of an `Asset`. */
  replace?: boolean;
}

/** A tile: the charts of a UV set that share a map. Its grid depends on maps and settings: `grid` of the asset. */
export interface Tile {
  udim: number;
  uvSet: number;
  layer: number;
}

/** Kinds of images: where a texel is looked up in the tile, minus its own place, plus the tile's place; the warp
 * itself; the derivatives of the redirection (du'/du, du'/dv, dv'/du, dv'/dv), and their largest singular value; the
 * UV in another set of where the redirection leads, and minus that of the texel's own place. */
export type Kind = "uv" | "delta" | "udim" | "warp" | "jacobian" | "filterScale" | "uvSet" | "uvSetDelta";

/** An image to fetch: `width * height` texels of 4 numbers for `jacobian`, 1 for `filterScale`, and 2 for others. */
export interface ImageFetch {
  tile: number;
  kind: Kind;
  width: number;
  height: number;
  /** Bits of half floats in the place of 32-bit floats. */
  half?: boolean;
  /** The other UV set of the kinds `uvSet` and `uvSetDelta`. */
  uvSet?: number;
}

/** Points to fetch; by default their positions and rotations. */
export interface PointFetch {
  carrier: { readonly number: number };
  /** Either `rotations` or `matrices`. */
  outputs?: (keyof Carried)[];
}

export type Fetch = ImageFetch | PointFetch;

/** The result of `redirect`: images and points, both in the order of their fetches, and the report of each tile. */
export interface Redirected {
  images: (Float32Array | Uint16Array)[];
  carried: Carried[];
  reports: Report[];
  /** The median of the edges' lengths in the pose, as multiples of those at rest, and the spread of these ratios: under
   * 0.001 the pose is only scaled. */
  scale: number;
  scaleSpread: number;
}

/** Points to bind to the surface at rest, by one of `uvs`, `corners` and `positions`. */
export interface CarrierSettings {
  /** UVs among all tiles of the set, two numbers per point; and the layer of each point, or the first one there. */
  uvs?: Numbers;
  layers?: Uint32Array;
  /** Three corners of one face per point, and their weights, three numbers per point. */
  corners?: Uint32Array;
  weights?: Numbers;
  /** The nearest point of the surface to each of these, three numbers per point, and the largest distance from it. */
  positions?: Numbers;
  farthest?: number;
  /** The UV set whose tiles carry the points. */
  uvSet?: number;
  /** Heights above the surface along its normal, one number per point. */
  heights?: Numbers;
  /** Frames at rest: quaternions x, y, z, w, or matrices row by row, nine numbers per point. */
  frames?: Numbers;
  /** The number of the rigid piece that each point belongs to; 0xffffffff = none. */
  pieces?: Uint32Array;
  /** Points of rigid features move as one body each, or all with the surface; `none`: as if nothing were redirected. */
  fit?: "feature" | "surface" | "none";
  /** The height up to which points of a body are blended to the surface. */
  skirt?: number;
}

/** Points in the pose; what was not asked for is missing. */
export interface Carried {
  /** Three numbers per point. */
  positions?: Float32Array;
  /** Rotations from the frames at rest: quaternions x, y, z, w. */
  rotations?: Float32Array;
  /** The same as matrices row by row: nine numbers per point. */
  matrices?: Float32Array;
  /** The stretch of the surface that is left: two factors per point, the larger first. */
  stretch?: Float32Array;
  /** UV of the surface that has the texture of the point, with the tile's place: two numbers per point. */
  uvs?: Float32Array;
}

/** Sizes of a carrier, and what its points are bound to. */
export interface CarrierInfo {
  points: number;
  /** Points outside of all charts, in folded UVs, and too far from the surface: they move with the surface alone. */
  outside: number;
  folded: number;
  tooFar: number;
  /** For each point 0, or which of these it is: 1, 2 or 3. */
  states: Uint8Array;
  /** Features that points moved with in the last fetch, and the largest distance of a rim of one from the surface. */
  features: number;
  rim: number;
  bytes: number;
  milliseconds: number;
}

/** A line of the log, as docs/hosts.md lists their codes and values: `PoseScale` for `VRTM_LOG_CODE_POSE_SCALE`. */
export interface LogEntry {
  /** A warning is for the artist. */
  level: "warning" | "info";
  code: string;
  /** The tile that it is about; `null` = none. */
  udim: number | null;
  uvSet: number;
  layer: number;
  values: number[];
  message: string;
}

/** Settings of a new asset. */
export interface AssetSettings {
  /** Gets each line of the log; without it, warnings go to `console.warn`. It cannot call the asset. */
  log?: (entry: LogEntry) => void;
}

/** Relative changes of length of rigid material. */
export interface Strain {
  rms: number;
  median: number;
  p95: number;
  p99: number;
  max: number;
}

/** A painted feature that is worse than without vrtm: its RMS strain rose by more than 0.02. */
export interface WorstFeature {
  /** Its centre, among all tiles. */
  uv: [number, number];
  /** Its area in UV units: that of the tile is 1. */
  area: number;
  /** Its RMS strain with the mesh's own UVs, and with the warp. */
  before: number;
  after: number;
  /** A chart's border touches it. */
  atBorder: boolean;
}

/** Strain with the mesh's own UVs and with the warp, and painted features: connected areas that are rigid. */
export interface Measured {
  before: Strain;
  after: Strain;
  features: number;
  featuresWorse: number;
  /** Features with an RMS strain over 0.05. */
  featuresStrainedBefore: number;
  featuresStrainedAfter: number;
  /** The features that are worse, the worst first: at most 16. */
  worst: WorstFeature[];
}

/** Figures of a tile's last solve. */
export interface Report {
  udim: number;
  grid: [number, number];
  energyBefore: number;
  energy: number;
  /** Least corner Jacobian: over 0 certifies that the warp is one-to-one. */
  minJacobian: number;
  folds: number;
  /** Longest displacement, in cells. */
  maxDisplacement: number;
  charts: number;
  /** Charts that got the identity in the place of a warp. */
  chartsFallback: number;
  nodesActive: number;
  /** The time budget ended the solve. */
  truncated: boolean;
  milliseconds: number;
  /** `null` unless it was measured. */
  strain: Measured | null;
}

/** A mesh with its tiles, their maps, carriers and results. */
export class Asset extends AssetMethods<false> {
  #module: Module | undefined;
  #busy = false;

  /** Reads a mesh, after `load`. */
  constructor(mesh: Mesh, { log }: AssetSettings = {}, threads = 1) {
    super();
    this.#module = guarded(() => new module.Asset(mesh, (entry: LogEntry) => tell(entry, log), threads));
    this.tiles = this.call("tiles", []);
  }

  free(): void {
    if (this.#module) {
      this.call("free", []);
      this.#module = undefined;
    }
  }

  /** @internal */
  call<T>(name: string, given: unknown[], make: (value: any) => T = (value) => value): T {
    if (!this.#module) {
      throw new VrtmError("Freed", "the asset was freed");
    }
    if (this.#busy) {
      throw new VrtmError("Busy", "the asset is in use by the call that tells this line of the log");
    }
    const module = this.#module as unknown as Record<string, (...given: unknown[]) => unknown>;
    this.#busy = true;
    try {
      return make(guarded(() => module[name](...given)));
    } finally {
      this.#busy = false;
    }
  }
}
