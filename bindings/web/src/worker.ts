/** The worker of a `WorkerAsset`: it has one asset, and answers one question after the other. */
import { Asset, load, type LogEntry, type Mesh } from "./index.js";
import { VrtmError, type Answer, type Question } from "./methods.js";
import { help, share, type Shared } from "./module.js";

let asset: Asset | undefined;
const post = (answer: Answer, transfer: Transferable[] = []) =>
  (self as unknown as Worker).postMessage(answer, transfer);

async function answer({ name, given }: Question): Promise<unknown> {
  if (name === "help") {
    return help(given as Shared);
  }
  if (name !== "create") {
    return asset!.call(name, given);
  }
  const [mesh, wasm, helpers] = given as [Mesh, string | undefined, number];
  const shared = helpers > 0 ? await share(wasm) : await load(wasm);
  asset = new Asset(mesh, { log: (log: LogEntry) => post({ log }) }, helpers + 1);
  return [asset.tiles, shared];
}

/** The memory of all arrays in a value, which goes to the page without a copy. */
function buffers(value: unknown): Transferable[] {
  if (ArrayBuffer.isView(value)) {
    return [value.buffer as ArrayBuffer];
  }
  return value && typeof value === "object" ? Object.values(value).flatMap(buffers) : [];
}

// Questions are answered in their order, also while the first one loads.
let last: Promise<void> = Promise.resolve();
self.onmessage = ({ data }: MessageEvent<Question>) => {
  last = last.then(async () => {
    try {
      const value = await answer(data);
      post({ id: data.id, value }, buffers(value));
    } catch (thrown) {
      const { message } = thrown as Error;
      post({ id: data.id, error: { code: thrown instanceof VrtmError ? thrown.code : "Internal", message } });
    }
  });
};
