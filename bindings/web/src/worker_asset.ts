/** An asset in a worker of its own, so that a page draws on while it is solved. */
import type { Mesh, Numbers, Options, Settings, Texels, Tile } from "./index.js";
import type { Answer, Call, Created, Fetch, Redirected } from "./messages.js";

export type { Fetch, Redirected } from "./messages.js";

interface Waiting {
  resolve: (value: any) => void;
  reject: (error: Error) => void;
}

/** Has the methods of `Asset`, which return promises here. */
export class WorkerAsset {
  tiles: Tile[] = [];
  #worker: Worker;
  #waiting = new Map<number, Waiting>();
  #next = 0;
  #solving = false;
  #latest: (Waiting & { call: Call }) | undefined;

  private constructor(worker: Worker) {
    this.#worker = worker;
    worker.onmessage = ({ data }: MessageEvent<Answer>) => {
      const waiting = this.#waiting.get(data.id);
      this.#waiting.delete(data.id);
      if ("error" in data) {
        waiting?.reject(Object.assign(new Error(data.error.message), { name: data.error.name }));
      } else {
        waiting?.resolve(data.value);
      }
    };
    worker.onerror = (event) => this.#fail(new Error(event.message || "the worker could not be loaded"));
  }

  /** Reads a mesh in a new worker. `worker` is one that was made of this package's worker.js, where a bundler moves it; `wasm`
   * is the address of vrtm_bg.wasm, where it is not beside it. */
  static async create(mesh: Mesh, { worker, wasm }: { worker?: Worker; wasm?: string } = {}): Promise<WorkerAsset> {
    const own = worker ?? new Worker(new URL("./worker.js", import.meta.url), { type: "module" });
    const asset = new WorkerAsset(own);
    try {
      asset.tiles = (await asset.#ask({ name: "create", mesh, wasm })) as Created;
    } catch (error) {
      asset.free();
      throw error;
    }
    return asset;
  }

  setRigidity(tile: number, values: Texels | null, width = 0, height = 0): Promise<void> {
    return this.#ask({ name: "setRigidity", tile, values, width, height });
  }

  setMask(tile: number, values: Texels | null, width = 0, height = 0): Promise<void> {
    return this.#ask({ name: "setMask", tile, values, width, height });
  }

  updateRigidity(tile: number, values: Texels, width: number, height: number, part: number[]): Promise<void> {
    return this.#ask({ name: "updateRigidity", tile, values, width, height, part });
  }

  setSettings(tile: number, settings: Settings): Promise<void> {
    return this.#ask({ name: "setSettings", tile, settings });
  }

  cornerUvs(uvSet = 0): Promise<Float32Array> {
    return this.#ask({ name: "cornerUvs", uvSet });
  }

  /** Solves for a pose, and fetches images. While a solve is under way the last request alone waits: one that another has
   * replaced gives `null`. */
  redirect(positions: Numbers, options: Options, fetches: Fetch[]): Promise<Redirected | null> {
    const call: Call = { name: "redirect", positions, options, fetches };
    return new Promise((resolve, reject) => {
      this.#latest?.resolve(null);
      this.#latest = { call, resolve, reject };
      this.#solve();
    });
  }

  /** Ends the worker; what is under way is rejected. */
  free(): void {
    this.#worker.terminate();
    this.#fail(new Error("the asset was freed"));
  }

  #solve(): void {
    const latest = this.#latest;
    if (this.#solving || !latest) {
      return;
    }
    this.#latest = undefined;
    this.#solving = true;
    this.#ask<Redirected>(latest.call)
      .then(latest.resolve, latest.reject)
      .finally(() => {
        this.#solving = false;
        this.#solve();
      });
  }

  #ask<T>(call: Call): Promise<T> {
    return new Promise((resolve, reject) => {
      const id = this.#next++;
      this.#waiting.set(id, { resolve, reject });
      this.#worker.postMessage({ ...call, id });
    });
  }

  #fail(error: Error): void {
    const latest = this.#latest;
    this.#latest = undefined;
    latest?.reject(error);
    this.#waiting.forEach(({ reject }) => reject(error));
    this.#waiting.clear();
  }
}
