/** An asset in a worker of its own, so that a page draws on while it is solved. */
import type { AssetSettings, Fetch, LogEntry, Mesh, Numbers, Options, Redirected } from "./index.js";
import { AssetMethods, VrtmError, tell, type Answer, type Code, type Question } from "./methods.js";

export type { Fetch, Redirected } from "./index.js";
export { Carrier, VrtmError, type Code } from "./methods.js";

/** Settings of a new asset and of its worker. */
export interface WorkerSettings extends AssetSettings {
  /** A worker that was made of this package's worker.js, where a bundler moves it. */
  worker?: Worker;
  /** More such workers, which share in each solve: they take as many processors. Without `worker`, a page that is
   * `crossOriginIsolated` has up to 3 by itself. */
  helpers?: Worker[];
  /** The address of vrtm_bg.wasm, where it is not beside the worker; with helpers, of shared/vrtm_bg.wasm. */
  wasm?: string;
}

interface Waiting {
  resolve: (value: any) => void;
  reject: (error: VrtmError) => void;
}

const used = new WeakSet<Worker>();

/** The methods of `Asset` in a worker: calls are answered in their order, but for poses that wait. */
export class WorkerAsset extends AssetMethods<true> {
  #worker: Worker;
  #terminate: (() => void)[] = [];
  #waiting = new Map<number, Waiting>();
  #next = 0;
  #ended: VrtmError | undefined;
  /** Redirects that the worker has; and the newest, which waits until it has none. */
  #redirects = 0;
  #newest: (Waiting & { given: unknown[] }) | undefined;

  private constructor(worker: Worker, helpers: Worker[], log?: (entry: LogEntry) => void) {
    super();
    this.#worker = worker;
    const ended = (why: string) => this.#end("WorkerEnded", `the worker has ended: ${why}`);
    helpers.forEach((helper) => (helper.onmessage = ({ data }) => ended(data.error.message)));
    worker.onmessage = ({ data }: MessageEvent<Answer>) => {
      if ("log" in data) {
        return tell(data.log, log);
      }
      const waiting = this.#waiting.get(data.id);
      this.#waiting.delete(data.id);
      if ("error" in data) {
        waiting?.reject(new VrtmError(data.error.code, data.error.message));
      } else {
        waiting?.resolve(data.value);
      }
    };
    for (const one of [worker, ...helpers]) {
      this.#terminate.push(one.terminate.bind(one));
      one.terminate = () => this.#end("WorkerEnded", "the worker was terminated");
      one.onerror = ({ message }) => ended(message || "it could not be loaded");
      one.onmessageerror = () => ended("its answer cannot be read");
    }
  }

  /** Reads a mesh in a new worker. */
  static async create(mesh: Mesh, settings: WorkerSettings = {}): Promise<WorkerAsset> {
    const start = () => new Worker(new URL("./worker.js", import.meta.url), { type: "module" });
    const { worker: own = start(), wasm, log } = settings;
    const cores = !settings.worker && globalThis.crossOriginIsolated ? navigator.hardwareConcurrency : 1;
    const { helpers = Array.from({ length: Math.min(cores - 1, 3) }, start) } = settings;
    if ([own, ...helpers].some((one) => used.has(one))) {
      throw new VrtmError("InvalidArgument", "worker: it has an asset already");
    }
    [own, ...helpers].forEach((one) => used.add(one));
    const asset = new WorkerAsset(own, helpers, log);
    try {
      const [tiles, given] = await asset.call<any>("create", [mesh, wasm, helpers.length]);
      asset.tiles = tiles;
      helpers.forEach((helper) => helper.postMessage({ id: -1, name: "help", given } satisfies Question));
    } catch (error) {
      own.terminate();
      throw error;
    }
    return asset;
  }

  override async solve(positions: Numbers, options?: Options): Promise<void> {
    await this.redirect(positions, { ...options, replace: false });
  }

  override redirect(positions: Numbers, options: Options = {}, fetches: Fetch[] = []): Promise<Redirected | null> {
    const isSolved = options?.replace === false;
    return new Promise((resolve, reject) => {
      if (isSolved) {
        // A pose that waits keeps its place before this one.
        this.#begin();
      }
      this.#newest?.resolve(null);
      this.#newest = { given: [positions, options, fetches], resolve, reject };
      if (isSolved || this.#redirects === 0) {
        this.#begin();
      }
    });
  }

  /** Ends the worker; what is under way is rejected. */
  async free(): Promise<void> {
    this.#end("Freed", "the asset was freed");
  }

  /** Gives the worker the pose that waits. */
  #begin(): void {
    const newest = this.#newest;
    if (newest) {
      this.#newest = undefined;
      this.#redirects++;
      const done = () => --this.#redirects === 0 && this.#begin();
      this.call("redirect", newest.given).then(newest.resolve, newest.reject).finally(done);
    }
  }

  /** @internal */
  call<T>(name: string, given: unknown[], make: (value: any) => T = (value) => value): Promise<T> {
    const answer = new Promise<any>((resolve, reject) => {
      if (this.#ended) {
        return reject(this.#ended);
      }
      const id = this.#next++;
      try {
        this.#worker.postMessage({ id, name, given } satisfies Question);
        this.#waiting.set(id, { resolve, reject });
      } catch (error) {
        reject(new VrtmError("InvalidArgument", `${name}: ${(error as Error).message}`));
      }
    });
    return answer.then(make);
  }

  /** Ends the worker. All calls fail from now on; the first reason stays. */
  #end(code: Code, message: string): void {
    this.#terminate.forEach((terminate) => terminate());
    this.#ended ??= new VrtmError(code, message);
    this.#newest?.reject(this.#ended);
    this.#newest = undefined;
    for (const { reject } of this.#waiting.values()) {
      reject(this.#ended);
    }
    this.#waiting.clear();
  }
}
