/** Meshes of three.js whose textures keep their shape while they deform. */
import {
  DataTexture, DataUtils, HalfFloatType, LinearFilter, RGFormat, RepeatWrapping, Vector2, type Material, type Mesh,
  type SkinnedMesh,
} from "three";
import type { Options, Redirected as Result, Report, Settings, Texels } from "../index.js";
import { WorkerAsset, type WorkerSettings } from "../worker_asset.js";
import { Source, type SourceOptions } from "./geometry.js";
import { patch, replace, type Uniforms } from "./material.js";

export type { Result };

export interface RedirectSettings extends SourceOptions, WorkerSettings {
  /** What is rigid: `size` rows of `size` texels, the first one is the image's first row. */
  rigidity: Texels;
  size: number;
  /** Quality of updates that name none. By default `normal`. */
  quality?: Options["quality"];
  scale?: Options["scale"];
  /** Cells of the grid along each side, and further settings of the tile. */
  grid?: number;
  settings?: Settings;
  /** Texels of the redirection map along each side. By default those of the rigidity, at most 512. */
  mapSize?: number;
  /** Draw the pose that the map belongs to, and not a newer one, so that paint does not swim. By default true. */
  hold?: boolean;
}

/** Prepares meshes that share textures, in a worker of their own. They look as before until the first `update`. */
export async function redirect(meshes: Mesh | Mesh[], settings: RedirectSettings): Promise<Redirected> {
  const { rigidity, size, grid, worker, wasm, log } = settings;
  const all = [meshes].flat();
  const source = new Source(all, settings);
  const asset = await WorkerAsset.create(source.mesh, { worker, wasm, log });
  try {
    await asset.setSettings(0, { grid, ...settings.settings });
    await asset.setRigidity(0, rigidity, size, size);
    return new Redirected(all, source, asset, settings);
  } catch (error) {
    void asset.free();
    throw error;
  }
}

/** What a mesh is drawn with in place of its newest pose. */
type Shown = Partial<Pick<SkinnedMesh, "skeleton" | "bindMatrixInverse" | "morphTargetInfluences">>;

export class Redirected {
  /** `strength.value`, 0 to 1, fades from own UVs to redirected ones; pixels left of `wipe.value` have own UVs. */
  readonly uniforms: Uniforms;
  /** Report of the last map, and the map: two half floats per texel, the first row at v = 1. */
  report: Report | null = null;
  delta: Uint16Array;
  readonly mapSize: number;
  #size: number;
  #texture: DataTexture;
  #shown: Shown[];
  #undo: (() => void)[] = [];
  #settings: RedirectSettings;

  /** @internal */
  constructor(
    readonly meshes: readonly Mesh[], readonly source: Source, readonly asset: WorkerAsset, settings: RedirectSettings,
  ) {
    const { size, uv, mapSize = Math.min(size, 512), hold = true } = settings;
    this.#settings = settings;
    this.#size = size;
    this.mapSize = mapSize;
    this.delta = new Uint16Array(2 * mapSize * mapSize);
    this.#texture = new DataTexture(this.delta, mapSize, mapSize, RGFormat, HalfFloatType);
    this.#texture.magFilter = this.#texture.minFilter = LinearFilter;
    // UVs of charts that repeat the tile are outside of it.
    this.#texture.wrapS = this.#texture.wrapT = RepeatWrapping;
    this.#texture.needsUpdate = true;
    this.uniforms = { map: { value: this.#texture }, strength: { value: 1 }, wipe: { value: 0 } };
    this.#shown = meshes.map(() => ({}));
    try {
      for (const material of new Set<Material>(meshes.flatMap(({ material }) => material))) {
        this.#undo.push(patch(material, this.uniforms, { uv, flipY: source.flipY }));
      }
    } catch (error) {
      this.dispose();
      throw error;
    }
    if (hold) {
      meshes.forEach((mesh, k) => this.#undo.push(...show(mesh, this.#shown[k])));
    }
  }

  /** Solves for the present pose, and shows it with its map. The newest pose wins: `null` if one came before this one's
   * turn, or after `dispose`. */
  async update(quality = this.#settings.quality, options: Options = {}): Promise<Result | null> {
    const pose = this.source.pose();
    const held = this.meshes.map(capture);
    const { scale } = this.#settings;
    const [width, height] = [this.mapSize, this.mapSize];
    const result = await this.asset
      .redirect(pose, { quality, scale, ...options }, [{ tile: 0, kind: "delta", width, height, half: true }])
      .catch((error) => {
        if (this.#undo.length > 0) {
          throw error;
        }
        return null;
      });
    if (!result || this.#undo.length === 0) {
      return null;
    }
    this.report = result.reports[0];
    this.delta = this.#texture.image.data = result.images[0] as Uint16Array;
    this.#texture.needsUpdate = true;
    held.forEach((call, k) => call(this.#shown[k]));
    return result;
  }

  /** Sets what is rigid, for the next `update`. */
  setRigidity(values: Texels, size = this.#size): Promise<void> {
    this.#size = size;
    return this.asset.setRigidity(0, values, size, size);
  }

  /** Replaces a part of it: first column and row, columns and rows. `values` is the whole map. */
  updateRigidity(values: Texels, part: number[]): Promise<void> {
    return this.asset.updateRigidity(0, values, this.#size, this.#size, part);
  }

  /** The UV that a place of the mesh, as a ray hits it, has its paint from. */
  uvAt(uv: { x: number; y: number }): Vector2 {
    return new Vector2(...lookUp(this.delta, this.mapSize, uv.x, uv.y, this.source.flipY)).add(uv);
  }

  /** Restores meshes and materials, and ends the worker. */
  dispose(): void {
    this.#undo.splice(0).forEach((call) => call());
    this.#shown.forEach(({ skeleton }) => skeleton?.dispose());
    this.#texture.dispose();
    void this.asset.free();
  }
}

/** What a map of `n` x `n` texels adds to a UV of a mesh, by bilinear look-up; `flipY` is that of its `Source`. */
export function lookUp(map: Uint16Array, n: number, u: number, v: number, flipY: boolean): [number, number] {
  const [x, y] = [u, flipY ? 1 - v : v].map((t) => t * n - 0.5);
  const [i, j] = [Math.floor(x), Math.floor(y)];
  const wrap = (k: number) => ((k % n) + n) % n;
  const [du, dv] = [0, 1].map((channel) => {
    const at = (i: number, j: number) => DataUtils.fromHalfFloat(map[2 * (wrap(j) * n + wrap(i)) + channel]);
    const row = (j: number) => at(i, j) * (i + 1 - x) + at(i + 1, j) * (x - i);
    return row(j) * (j + 1 - y) + row(j + 1) * (y - j);
  });
  return [du, flipY ? dv : -dv];
}

/** Notes a mesh's pose, and returns what shows it. */
function capture(mesh: Mesh | SkinnedMesh): (shown: Shown) => void {
  const morphTargetInfluences = mesh.morphTargetInfluences?.slice();
  const skinned = "skeleton" in mesh ? mesh : undefined;
  // The place of the mesh is none of its pose: bones have theirs in the world.
  const bindMatrixInverse = skinned?.bindMatrixInverse.clone();
  skinned?.skeleton.update();
  const matrices = skinned?.skeleton.boneMatrices!.slice();
  return (shown) => {
    Object.assign(shown, { morphTargetInfluences, bindMatrixInverse });
    if (skinned && matrices) {
      shown.skeleton ??= skinned.skeleton.clone().computeBoneTexture();
      shown.skeleton.boneMatrices!.set(matrices);
      shown.skeleton.boneTexture!.needsUpdate = true;
    }
  };
}

/** Draws a mesh in the pose that is shown, and returns what takes that back. Its own pose is there before and after. */
function show(mesh: Mesh, shown: Shown): (() => void)[] {
  const own = mesh as Shown;
  const swap = () => {
    for (const name of ["skeleton", "bindMatrixInverse", "morphTargetInfluences"] as const) {
      if (shown[name]) {
        const held = shown[name];
        Object.assign(shown, { [name]: own[name] });
        Object.assign(own, { [name]: held });
      }
    }
  };
  const hooks = ["onBeforeRender", "onAfterRender", "onBeforeShadow", "onAfterShadow"] as const;
  return hooks.map((name) => replace(mesh, name, (before: any) => (...given: unknown[]) => {
    swap();
    before.apply(mesh, given);
  }));
}
