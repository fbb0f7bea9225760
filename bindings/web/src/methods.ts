/** All that `Asset` and `WorkerAsset`, which returns promises, have in common: each method is here, once. */
import type {
  Carried, CarrierInfo, CarrierSettings, Fetch, Kind, LogEntry, Numbers, Options, Redirected, Report, Settings, Texels,
  Tile,
} from "./index.js";

type Returned<Later extends boolean, T> = Later extends true ? Promise<T> : T;

/** An asset. After an error everything is as it was before the call. All outputs are new arrays of the size that is
 * stated. */
export abstract class AssetMethods<Later extends boolean> {
  tiles: readonly Tile[] = [];

  /** Calls the module; `make` makes of its answer what is returned. @internal */
  abstract call<T>(name: string, given: unknown[], make?: (value: any) => T): Returned<Later, T>;

  /** Frees the asset: all calls after that are errors, `Freed`. */
  abstract free(): Returned<Later, void>;

  /** Cells in u and v of a tile's grid, with its present rigidity and settings. */
  grid(tile: number): Returned<Later, [number, number]> {
    return this.call("grid", [tile]);
  }

  /** Sets a tile's rigidity, 0 (elastic) to 1 (rigid); `null` removes it. */
  setRigidity(tile: number, values: Texels | null, width = 0, height = 0): Returned<Later, void> {
    return this.call("setMap", [false, tile, values, width, height]);
  }

  /** Sets a tile's warp mask: texels under 0.5 do not move; `null` removes it. */
  setMask(tile: number, values: Texels | null, width = 0, height = 0): Returned<Later, void> {
    return this.call("setMap", [true, tile, values, width, height]);
  }

  /** Replaces a part of the rigidity: first column and row, columns and rows. `values` is the whole map. */
  updateRigidity(tile: number, values: Texels, width: number, height: number, part: number[]): Returned<Later, void> {
    return this.call("updateRigidity", [tile, values, width, height, part]);
  }

  setSettings(tile: number, settings: Settings): Returned<Later, void> {
    return this.call("setSettings", [tile, settings]);
  }

  /** Solves all tiles for a pose: three numbers per vertex. */
  solve(positions: Numbers, options: Options = {}): Returned<Later, void> {
    return this.call("redirect", [positions, options, []], () => undefined);
  }

  /** Solves for a pose, and fetches outputs of that solve. In a worker the newest pose wins, by default: `null` if one
   * came before this one's turn (`Options.replace`). */
  redirect(
    positions: Numbers,
    options: Options = {},
    fetches: Fetch[] = [],
  ): Later extends true ? Promise<Redirected | null> : Redirected {
    return this.call<any>("redirect", [positions, options, fetches]) as any;
  }

  /** An image of the last solve: 2 numbers per texel (`jacobian` 4, `filterScale` 1), first row at v = 1. */
  fetch(tile: number, kind: Kind, width: number, height: number, uvSet?: number): Returned<Later, Float32Array> {
    return this.call("fetch", [{ tile, kind, width, height, uvSet }]);
  }

  /** The same as the bits of half floats, as textures take them (WebGL's `HALF_FLOAT`). */
  fetchHalf(tile: number, kind: Kind, width: number, height: number, uvSet?: number): Returned<Later, Uint16Array> {
    return this.call("fetch", [{ tile, kind, width, height, uvSet, half: true }]);
  }

  /** The redirected UV of each face corner in a UV set, two numbers each. */
  cornerUvs(uvSet = 0): Returned<Later, Float32Array> {
    return this.call("cornerUvs", [uvSet]);
  }

  report(tile: number): Returned<Later, Report> {
    return this.call("report", [tile]);
  }

  /** Binds points to the surface: studs, scales, hair roots, vertices of detail meshes. */
  carrier(settings: CarrierSettings): Returned<Later, Carrier<Later>> {
    return this.call("carrier", [settings], (number: number) => new Carrier(number, this));
  }
}

/** Points bound to the surface at rest. They follow the solves that come after, and are freed with their asset. */
export class Carrier<Later extends boolean = false> {
  #asset: AssetMethods<Later>;

  /** @internal */
  constructor(readonly number: number, asset: AssetMethods<Later>) {
    this.#asset = asset;
  }

  info(): Returned<Later, CarrierInfo> {
    return this.#asset.call("carrierInfo", [this.number]);
  }

  /** The points in the pose of the last solve; without arguments their positions and rotations. */
  fetch(...outputs: (keyof Carried)[]): Returned<Later, Carried> {
    const names = outputs.length > 0 ? outputs : undefined;
    return this.#asset.call("fetch", [{ carrier: { number: this.number }, outputs: names }]);
  }

  free(): Returned<Later, void> {
    return this.#asset.call("freeCarrier", [this.number]);
  }
}

/** Kinds of errors. `Busy`: the log function calls its asset; `WorkerEnded`: by an error, as for want of memory, or by
 * `terminate`. */
export type Code =
  | "InvalidArgument" | "Unsupported" | "OutOfMemory" | "NotSolved" | "Internal" | "Busy" | "NotLoaded" | "Freed"
  | "WorkerEnded";

/** Every error of this package: the message names the argument. */
export class VrtmError extends Error {
  override name = "VrtmError";

  constructor(readonly code: Code, message: string) {
    super(message);
  }
}

/** A call of the module. */
export type Question = { id: number; name: string; given: unknown[] };
type Failed = { id: number; error: { code: Code; message: string } };
export type Answer = { id: number; value: unknown } | Failed | { log: LogEntry };

/** Tells a line of the log. */
export function tell(entry: LogEntry, log?: (entry: LogEntry) => void): void {
  try {
    if (log) {
      log(entry);
    } else if (entry.level === "warning") {
      console.warn(`vrtm: ${entry.message}`);
    }
  } catch (error) {
    console.error("vrtm: the log function has thrown", error);
  }
}
