/** Few maps whose sums, with weights per frame, stand for the redirections of a clip: docs/games.md. */
import {
  Camera, DataArrayTexture, DataUtils, GLSL3, HalfFloatType, Mesh, PlaneGeometry, RGFormat, RepeatWrapping,
  ShaderMaterial, WebGLRenderTarget, type Material, type Texture, type WebGLRenderer,
} from "three";
import type { Options } from "../index.js";
import type { WorkerAsset } from "../worker_asset.js";
import { patch, replace, type PatchOptions, type Uniforms } from "./material.js";

/** Rows of numbers as sums of fewer: row f is the sum over k of `weights[f][k]` times `maps[k]`. */
export interface Sums {
  maps: Float32Array[];
  /** Per row; the largest of each map is near 1 or -1. */
  weights: number[][];
  /** Largest distance of each row's sum from the row, over its points. */
  errors: number[];
}

export interface FitOptions {
  /** The largest distance of a sum from its row. */
  bound: number;
  /** Numbers per point of a row. */
  components: number;
  /** Rounds numbers of maps to those that are stored. */
  round?: (x: number) => number;
  /** Waits between steps, and may throw to end the fit. */
  tick?: () => Promise<void>;
}

/** Rounds to the nearest half float; three.js cuts digits off. */
const toHalf = (x: number): number => DataUtils.toHalfFloat(x * (1 + 2 ** -12));

function dot(a: ArrayLike<number>, b: ArrayLike<number>): number {
  let sum = 0;
  for (let k = 0; k < a.length; k++) {
    sum += a[k] * b[k];
  }
  return sum;
}

/** Adds `scale` times numbers. */
function add(to: Float32Array, scale: number, values: Float32Array): void {
  for (let k = 0; k < to.length; k++) {
    to[k] += scale * values[k];
  }
}

function farthest(row: Float32Array, components: number): number {
  let most = 0;
  for (let k = 0; k < row.length; k += components) {
    let square = 0;
    for (let c = 0; c < components; c++) {
      square += row[k + c] ** 2;
    }
    most = Math.max(most, square);
  }
  return Math.sqrt(most);
}

/** Sums within the bound, of the rows' leading singular vectors one by one, by inner products (Sirovich 1987). Each map
 * is rounded before its weights are fitted, and the next one takes what that left. */
export async function fit(rows: Float32Array[], options: FitOptions): Promise<Sums> {
  const { bound, components, round = Math.fround, tick = async () => {} } = options;
  const left = rows.map((row) => row.slice());
  const products: number[][] = [];
  for (const [f, row] of left.entries()) {
    products.push(left.map((other, g) => (g < f ? products[g][f] : dot(row, other))));
    await tick();
  }
  const maps: Float32Array[] = [];
  const weights = rows.map((): number[] => []);
  let errors = left.map((row) => farthest(row, components));
  while (Math.max(...errors) > bound) {
    if (maps.length === 2 * rows.length) {
      throw new Error(`no number of maps is within ${bound}`);
    }
    const longest = products.map((row, f) => row[f]).reduce((best, size, f, all) => (size > all[best] ? f : best), 0);
    let vector = products[longest];
    for (let turn = 0; turn < 100; turn++) {
      const next = products.map((row) => dot(row, vector));
      const length = Math.hypot(...next) || 1;
      vector = next.map((x) => x / length);
    }
    const most = Math.max(...vector.map(Math.abs));
    const map = new Float32Array(left[0].length);
    vector.forEach((share, f) => add(map, share * most, left[f]));
    map.forEach((x, k) => (map[k] = round(x)));
    const square = dot(map, map) || 1;
    const own = left.map((row) => Math.fround(dot(row, map) / square));
    own.forEach((weight, f) => {
      add(left[f], -weight, map);
      weights[f].push(weight);
      products[f] = products[f].map((product, g) => product - weight * own[g] * square);
    });
    maps.push(map);
    errors = left.map((row) => farthest(row, components));
    await tick();
  }
  return { maps, weights, errors };
}

/** Basis maps. */
export interface Basis {
  /** Texels per side. */
  size: number;
  /** Half floats of each: u and v to add per texel, for a weight of 1; v up, the first row at v = 1. */
  maps: Uint16Array[];
  /** Weights of each frame. */
  weights: number[][];
}

export interface BasisOptions {
  /** Texels of the maps per side: by default 256. */
  size?: number;
  /** The most that a sum may be off by, in UV: by default 4 texels of a texture of 4096. */
  bound?: number;
  quality?: Options["quality"];
  /** Waits between steps, of which the first ones solve a frame each, and may throw to end all. */
  tick?: (solved: number) => Promise<void>;
}

/** Basis maps of poses, with the errors of the sums in UV. Unlike `vrtm bake`, this does not look for folds of sums. */
export async function fitBasis(
  { asset }: { asset: WorkerAsset },
  poses: Float32Array[],
  { size = 256, bound = 4 / 4096, quality, tick = async () => {} }: BasisOptions = {},
): Promise<Basis & { errors: number[] }> {
  const deltas: Float32Array[] = [];
  for (const pose of poses) {
    await tick(deltas.length);
    const fetch = { tile: 0, kind: "delta", width: size, height: size } as const;
    const result = await asset.redirect(pose, { quality, replace: false }, [fetch]);
    deltas.push(result!.images[0] as Float32Array);
  }
  const round = (x: number) => DataUtils.fromHalfFloat(toHalf(x));
  const sums = await fit(deltas, { bound, components: 2, round, tick: () => tick(poses.length) });
  return { ...sums, size, maps: sums.maps.map((map) => Uint16Array.from(map, toHalf)) };
}

/** Reads what `vrtm bake --basis`, or the page, has written of one tile: `basis.json`, and the EXR files beside it. */
export async function loadBasis(url: string | URL): Promise<Basis> {
  const { EXRLoader } = await import("three/addons/loaders/EXRLoader.js");
  const base = new URL(url, globalThis.location?.href);
  const { format, files: [{ size: [size], maps: names }], frames } = await (await fetch(base)).json();
  if (format !== "half") {
    throw new Error(`${url}: maps in the format ${format} are not read, but those in half`);
  }
  const maps = (names as string[]).map(async (name) => {
    const bytes = await (await fetch(new URL(name, base))).arrayBuffer();
    const { data } = new EXRLoader().setDataType(HalfFloatType).parse(bytes);
    // three.js has the last row first, and four numbers per texel.
    const at = (k: number) => 4 * ((size - 1 - Math.floor(k / size)) * size + (k % size));
    return Uint16Array.from({ length: 2 * size * size }, (_, k) => data![at(k >> 1) + (k & 1)]);
  });
  return { size, maps: await Promise.all(maps), weights: frames.map(({ weights }: { weights: number[] }) => weights) };
}

export interface RedirectedByBasis {
  /** One per map, to be set before a mesh is drawn. All 0 at first, which moves nothing. */
  readonly weights: Float32Array;
  /** As those of `Redirected`: `strength`, `wipe`. */
  readonly uniforms: Uniforms;
  /** Restores meshes and materials. */
  dispose(): void;
}

/** Redirects textures by basis maps, without a solver or a worker. The GPU sums the maps up once per change of weights,
 * so that a pixel costs what it does with one map. */
export function redirectByBasis(
  meshes: Mesh | Mesh[],
  { size, maps }: Omit<Basis, "weights">,
  options: PatchOptions = {},
): RedirectedByBasis {
  const all = [meshes].flat();
  const materials = new Set<Material>(all.flatMap(({ material }) => material));
  const images = [...materials].flatMap((material) => Object.values(material) as (Texture | null)[]);
  // A clip without redirections has no map; GLSL has no empty array.
  const count = Math.max(1, maps.length);
  const texels = new Uint16Array(2 * size * size * count);
  maps.forEach((map, k) => texels.set(map, k * map.length));
  const array = new DataArrayTexture(texels, size, size, count);
  Object.assign(array, { format: RGFormat, type: HalfFloatType, needsUpdate: true });
  const sum = new WebGLRenderTarget(size, size, {
    format: RGFormat, type: HalfFloatType, depthBuffer: false, wrapS: RepeatWrapping, wrapT: RepeatWrapping,
  });
  const weights = new Float32Array(count);
  const material = new ShaderMaterial({
    glslVersion: GLSL3,
    uniforms: { maps: { value: array }, weights: { value: weights } },
    vertexShader: "void main() { gl_Position = vec4( position.xy, 0.0, 1.0 ); }",
    fragmentShader: /* glsl */ `
precision highp sampler2DArray;
uniform sampler2DArray maps;
uniform float weights[ ${count} ];
out vec4 moved;
void main() {
  moved = vec4( 0.0 );
  for ( int k = 0; k < ${count}; ++ k )
    moved.rg += weights[ k ] * texelFetch( maps, ivec3( gl_FragCoord.xy, k ), 0 ).rg;
}`,
  });
  const square = new Mesh(new PlaneGeometry(2, 2), material);
  square.frustumCulled = false;
  const camera = new Camera();
  let drawn: Float32Array | undefined;
  const draw = (renderer: WebGLRenderer) => {
    if (!drawn || weights.some((weight, k) => weight !== drawn![k])) {
      drawn = weights.slice();
      const [target, xr] = [renderer.getRenderTarget(), renderer.xr.enabled];
      renderer.xr.enabled = false;
      renderer.setRenderTarget(sum);
      renderer.render(square, camera);
      renderer.setRenderTarget(target);
      renderer.xr.enabled = xr;
    }
  };
  const uniforms: Uniforms = { map: { value: sum.texture }, strength: { value: 1 }, wipe: { value: 0 } };
  // By default UVs are those of the images that are there, as for a `Source`.
  const given = { flipY: images.find((image) => image?.isTexture)?.flipY ?? false, ...options };
  const undo = [
    ...[...materials].map((material) => patch(material, uniforms, given)),
    ...all.map((mesh) => replace(mesh, "onBeforeRender", (before) => function (this: Mesh, ...to) {
      before.apply(this, to);
      draw(to[0]);
    })),
  ];
  const dispose = () => {
    undo.splice(0).forEach((call) => call());
    [array, sum, square.geometry, material].forEach((made) => made.dispose());
  };
  return { weights, uniforms, dispose };
}
