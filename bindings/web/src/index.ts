/**
 * Variable rigidity texture mapping: given a mesh at rest, its UVs, a map of what is rigid, and a pose, `Asset` finds where each
 * texel has to be looked up so that painted features keep their shape. Everything runs on the CPU, in WebAssembly, on the
 * thread that calls: pages use `WorkerAsset` of "vrtm/worker", which has the same methods.
 */
import init, { Asset as Module } from "./wasm/vrtm.js";

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
  /** Milliseconds that the solve may take. */
  timeBudget?: number;
  maxCorrections?: number;
  tolerance?: number;
  /** Start from the last result: quicker, but the result depends on the order of frames. */
  warm?: boolean;
  temporalWeight?: number;
  /** Measure the strain on the mesh for the reports. Slow. */
  measure?: boolean;
}

/** A tile: the charts of a UV set that share a map. */
export interface Tile {
  udim: number;
  uvSet: number;
  layer: number;
  charts: number;
  /** Cells of the grid in u and v. */
  grid: [number, number];
}

/** Kinds of images: where a texel is looked up in the tile, minus its own place, plus the tile's place; the warp itself. */
export type Kind = "uv" | "delta" | "udim" | "warp";

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

let loading: Promise<unknown> | undefined;

/** Loads the WebAssembly, once; without an argument the file beside this one. */
export async function load(wasm?: URL | string | BufferSource | Response | Promise<Response>): Promise<void> {
  loading ??= start(wasm).catch((error) => {
    loading = undefined;
    throw error;
  });
  await loading;
}

async function start(wasm?: URL | string | BufferSource | Response | Promise<Response>): Promise<unknown> {
  const file = wasm ?? new URL("./wasm/vrtm_bg.wasm", import.meta.url);
  // Node fetches no files. Bundlers for browsers must not look for its module.
  if (file instanceof URL && file.protocol === "file:") {
    const module = "node:fs/promises";
    const { readFile } = (await import(/* @vite-ignore */ module)) as typeof import("node:fs/promises");
    return init({ module_or_path: await readFile(file) });
  }
  return init({ module_or_path: file });
}

/** A mesh with its tiles, their maps and results. After an error everything is as it was before the call. */
export class Asset {
  readonly tiles: Tile[];
  #module: Module;

  /** Reads a mesh, after `load`. Errors have a kind as their name (`InvalidArgument`) and tell the argument. */
  constructor(mesh: Mesh) {
    this.#module = new Module(mesh);
    this.tiles = this.#module.tiles() as Tile[];
  }

  /** Sets a tile's rigidity, 0 (elastic) to 1 (rigid); `null` removes it. */
  setRigidity(tile: number, values: Texels | null, width = 0, height = 0): void {
    this.#module.setRigidity(tile, values, width, height);
  }

  /** Sets a tile's warp mask: texels under 0.5 do not move; `null` removes it. */
  setMask(tile: number, values: Texels | null, width = 0, height = 0): void {
    this.#module.setMask(tile, values, width, height);
  }

  /** Replaces a part of the rigidity: first column and row, columns and rows. `values` is the whole map. */
  updateRigidity(tile: number, values: Texels, width: number, height: number, part: number[]): void {
    this.#module.updateRigidity(tile, values, width, height, new Uint32Array(part));
  }

  setSettings(tile: number, settings: Settings): void {
    this.#module.setSettings(tile, settings);
  }

  /** Solves all tiles for a pose: three numbers per vertex. */
  solve(positions: Numbers, options: Options = {}): void {
    this.#module.solve(positions, options);
  }

  /** A result as an image, two numbers per texel, first row at v = 1. */
  fetch(tile: number, kind: Kind, width: number, height: number): Float32Array {
    return this.#module.fetch(tile, kind, width, height, false) as Float32Array;
  }

  /** A result as the bits of half floats, as textures take them (WebGL's `HALF_FLOAT`). */
  fetchHalf(tile: number, kind: Kind, width: number, height: number): Uint16Array {
    return this.#module.fetch(tile, kind, width, height, true) as Uint16Array;
  }

  /** The redirected UV of each face corner, two numbers each. */
  cornerUvs(uvSet = 0): Float32Array {
    return this.#module.cornerUvs(uvSet);
  }

  report(tile: number): Report {
    return this.#module.report(tile) as Report;
  }

  /** Frees the asset's memory; it cannot be used after that. */
  free(): void {
    this.#module.free();
  }
}
