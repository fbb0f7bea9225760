/** The WebAssembly: loaded once on each thread that needs it. */
import { VrtmError } from "./methods.js";
import * as alone from "./wasm/vrtm.js";

export type Module = alone.Asset;
/** WebAssembly that is loaded, and its memory. */
export type Shared = [WebAssembly.Module, WebAssembly.Memory];

/** The build that is used: alone, or with memory that workers share. */
export let module: Pick<typeof alone, "Asset"> & {
  default(given: { module_or_path: any }): Promise<unknown>;
} = alone;
let loading: Promise<unknown> | undefined;
let loaded = false;
let ended: VrtmError | undefined;

/** Loads the WebAssembly, once; without an argument the file beside this one. */
export async function load(wasm?: URL | string | BufferSource | Response | Promise<Response>): Promise<void> {
  loading ??= start(wasm).catch((error) => {
    loading = undefined;
    throw new VrtmError("NotLoaded", `the WebAssembly cannot be loaded: ${(error as Error).message}`);
  });
  await loading;
  loaded = true;
}

/** Loads the build with shared memory in place of the other, in a worker; `help` takes what it returns. */
export async function share(wasm?: string): Promise<Shared> {
  const shared = await import("./wasm/shared/vrtm.js");
  module = shared;
  await load(wasm ?? new URL("./wasm/shared/vrtm_bg.wasm", import.meta.url));
  return shared.shared() as Shared;
}

/** Lends this worker to another one's asset, for ever. */
export async function help([module_or_path, memory]: Shared): Promise<void> {
  const shared = await import("./wasm/shared/vrtm.js");
  await shared.default({ module_or_path, memory });
  shared.help();
}

async function start(wasm?: URL | string | BufferSource | Response | Promise<Response>): Promise<unknown> {
  const file = wasm ?? new URL("./wasm/vrtm_bg.wasm", import.meta.url);
  // Node fetches no files. Bundlers for browsers must not look for its module.
  if (file instanceof URL && file.protocol === "file:") {
    const files = "node:fs/promises";
    const { readFile } = (await import(/* @vite-ignore */ files)) as typeof import("node:fs/promises");
    return module.default({ module_or_path: await readFile(file) });
  }
  return module.default({ module_or_path: file });
}

/** Calls the module, which throws its errors as an array of code and message. Anything else has ended it: WebAssembly
 * does not unwind, and what the call held is held for ever. */
export function guarded<T>(call: () => T): T {
  if (ended) {
    throw ended;
  }
  if (!loaded) {
    throw new VrtmError("NotLoaded", "the WebAssembly is not loaded yet: load() comes first");
  }
  try {
    return call();
  } catch (thrown) {
    if (Array.isArray(thrown)) {
      throw new VrtmError(thrown[0], thrown[1]);
    }
    const why = `the WebAssembly has ended, by a defect or because memory ran short (${(thrown as Error).message})`;
    ended = new VrtmError("Internal", `${why}: use another worker, or load the page again`);
    throw ended;
  }
}
