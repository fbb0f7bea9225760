/** The WebAssembly: loaded once on each thread that needs it. */
import { VrtmError } from "./methods.js";
import init from "./wasm/vrtm.js";

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
