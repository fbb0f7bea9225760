// What several programs need: a worker, and a small mesh.
import { Worker } from "node:worker_threads";

/** A worker as browsers have it, of a thread of Node. */
export class Thread extends Worker {
  static all = [];

  constructor(module = new URL("../dist/worker.js", import.meta.url)) {
    const start = `const { parentPort } = require("node:worker_threads");
      const postMessage = (value, transfer) => parentPort.postMessage(value, transfer);
      Object.assign(globalThis, { self: globalThis, postMessage });
      import("${module}").then(() => parentPort.on("message", (data) => self.onmessage({ data })));`;
    super(start, { eval: true });
    this.on("message", (data) => this.onmessage({ data })).on("error", (error) => this.onerror(error));
    Thread.all.push(this);
  }
}

/** Two squares side by side, with a feature in their middle. */
export function squares() {
  const indices = new Uint32Array([0, 1, 4, 3, 1, 2, 5, 4]);
  const mesh = {
    positions: new Float32Array([0, 0, 0, 1, 0, 0, 2, 0, 0, 0, 1, 0, 1, 1, 0, 2, 1, 0]),
    faceCounts: new Uint32Array([4, 4]),
    indices,
    uvs: new Float32Array([0, 0, 0.5, 0, 1, 0, 0, 1, 0.5, 1, 1, 1]),
    uvIndices: indices,
  };
  const inside = (k) => k >= 12 && k < 20;
  const values = new Uint8Array(32 * 32).map((_, k) => (inside(k % 32) && inside(k >> 5) ? 255 : 0));
  const pose = mesh.positions.map((x, k) => (k === 3 || k === 12 ? 1.3 : x));
  return { mesh, values, pose };
}
