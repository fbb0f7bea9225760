// A page whose server isolates it: its assets have helpers by themselves. `npm run build` comes first.
import assert from "node:assert/strict";
import { test } from "node:test";
import { fileURLToPath } from "node:url";

import { launch, serve, skip } from "./browser.mjs";
import { squares } from "./shared.mjs";

const isolated = { "cross-origin-opener-policy": "same-origin", "cross-origin-embedder-policy": "require-corp" };
for (const [headers, threads] of [[{}, 1], [isolated, 2]]) {
  test(`${threads} threads at least`, { skip, timeout: 300_000 }, async () => {
    const { server, url } = await serve(fileURLToPath(new URL("../dist", import.meta.url)), "<!doctype html>", headers);
    const browser = await launch();
    const page = await browser.newPage();
    await page.goto(url);
    await page.addScriptTag({ content: squares.toString() });
    const found = await page.evaluate(async () => {
      const { WorkerAsset } = await import("/worker_asset.js");
      // It has two processors, whatever the machine has.
      Object.defineProperty(navigator, "hardwareConcurrency", { value: 2 });
      const { mesh, values, pose } = globalThis.squares();
      const lines = [];
      const asset = await WorkerAsset.create(mesh, { log: ({ message }) => lines.push(message) });
      await asset.setRigidity(0, values, 32, 32);
      await asset.solve(pose, { measure: true });
      return [lines[0], (await asset.report(0)).strain.after.rms];
    });
    assert.match(found[0], new RegExp(`, ${threads} threads`));
    assert.ok(found[1] < 0.02, `strain ${found[1]}`);
    await browser.close();
    server.close();
  });
}
