/** Rigidity from a texture and from a brush, for pages in which artists paint. It runs on the thread that calls, after
 * `load`; pages have it beside a `WorkerAsset`, since strokes cannot wait for the solve that is under way. */
import type { Mesh, Numbers } from "./index.js";
import { guarded } from "./module.js";
import * as module from "./wasm/vrtm.js";

/** A texture: red, green, blue and alpha of each texel, as `ImageData` has them. */
export interface Picture {
  data: Uint8Array | Uint8ClampedArray;
  width: number;
  height: number;
}

type Size = readonly [number, number];

/** Rigidity maps of 8 bits, 255 = rigid. `size`, columns and rows, is by default that of the picture; their first rows
 * are the same. */
export const rigidity = {
  /** Rigid where a picture is at most `tolerance` from a colour, 0 to 1 per channel: black and white are 1.73 apart. */
  ofColour(picture: Picture, colour: readonly number[], tolerance = 0.2, size?: Size): Uint8Array {
    const channels = Float32Array.from(colour);
    return ofPicture(picture, size, (own, size) => module.ofColour(picture.data, own, size, channels, tolerance));
  },

  /** Rigid where a picture is brighter than a threshold, 0 to 1; 0 = the one that parts it best (Otsu). */
  ofBrightness(picture: Picture, threshold = 0, size?: Size): Uint8Array {
    return ofPicture(picture, size, (own, size) => module.ofBrightness(picture.data, own, size, threshold));
  },

  /** From 0 on plain ground to `ceiling`, 0 to 1, where a picture is drawn on. `features`: a rigidity map of `size`,
   * around whose rigid parts nothing is held; if it has none, nothing is. */
  ofDetail(picture: Picture, features?: Uint8Array, ceiling = 0.3, size?: Size): Uint8Array {
    return ofPicture(picture, size, (own, size) => module.ofDetail(picture.data, own, size, features, ceiling));
  },
};

type Make = (own: Uint32Array, size: Uint32Array) => Uint8Array;

function ofPicture({ width, height }: Picture, size: Size = [width, height], make: Make): Uint8Array {
  return guarded(() => make(Uint32Array.of(width, height), Uint32Array.from(size)));
}

/** The place of a surface that a ray hits: its triangle, and the own UV there, v up. */
export interface SurfaceHit {
  triangle: number;
  point: [number, number, number];
  uv: [number, number];
}

/** The texels under a brush, indices of a map whose first row is v = 1, and how much it covers each, 0 to 1. */
export interface Dab {
  texels: Uint32Array;
  cover: Float32Array;
}

/** The surface of a mesh of triangles in a pose, to paint on. */
export class Surface {
  #module: module.Surface;

  constructor({ positions, indices, uvs, uvIndices }: Mesh) {
    const [own, flat] = [uvIndices ?? Uint32Array.from(indices, (_, k) => k), Float32Array.from(uvs)];
    this.#module = guarded(() => new module.Surface(indices, own, flat, positions.length / 3));
  }

  /** Sets the pose, and the redirection through which the texture is seen: `delta` as half floats, 0 for own UVs. */
  pose(positions: Numbers, delta: Uint16Array, size: Size): void {
    guarded(() => this.#module.pose(positions, delta, Uint32Array.from(size)));
  }

  hit(from: readonly number[], way: readonly number[]): SurfaceHit | null {
    return guarded(() => this.#module.hit(Float32Array.from(from), Float32Array.from(way)));
  }

  /** The texels of a map of `size` that are seen within `radius` of a hit, on surface that hangs together with it: also
   * beyond seams, and not on the other side of a thin wall. `softness`, 0 to 1, is the part of it that fades. */
  dab({ triangle, point }: SurfaceHit, radius: number, softness: number, size: Size): Dab {
    const [at, texels] = [Float32Array.from(point), Uint32Array.from(size)];
    return guarded(() => this.#module.dab(triangle, at, radius, softness, texels) as Dab);
  }

  free(): void {
    this.#module.free();
  }
}
