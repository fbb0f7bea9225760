// Files of visitors: odd ones that are made here, and public characters of the folder VRTM_GLTF.
import assert from "node:assert/strict";
import { cpSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import { launch, serve, skip } from "./browser.mjs";
import { attributes, bytesOf, picture, sheet } from "./gltf.mjs";

const here = fileURLToPath(new URL("..", import.meta.url));
const folder = mkdtempSync(join(tmpdir(), "vrtm-files-"));
const timeout = 600_000;
let browser, served, page;
before(async () => {
  if (skip) {
    return;
  }
  await build({
    entryPoints: { own: `${here}tests/own.js`, worker: `${here}dist/worker.js` },
    alias: { "vrtm/three": `${here}dist/three/index.js` },
    nodePaths: [`${here}node_modules`],
    bundle: true, format: "esm", outdir: folder,
  });
  cpSync(`${here}dist/wasm/vrtm_bg.wasm`, join(folder, "vrtm_bg.wasm"));
  cpSync(`${here}node_modules/three/examples/jsm/libs/draco/gltf`, join(folder, "draco"), { recursive: true });
  const html = `<style>body { margin: 0 }</style><body><canvas></canvas><input type="file" multiple hidden>
    <script type="module" src="own.js"></script>`;
  served = await serve(folder, html);
  browser = await launch();
  page = await opened({ width: 480, height: 360 });
});
after(async () => {
  await browser?.close();
  served?.server.close();
  rmSync(folder, { recursive: true });
});

async function opened(viewport) {
  const page = await browser.newPage();
  page.setDefaultTimeout(timeout);
  await page.setViewport(viewport);
  await page.goto(served.url);
  await page.waitForFunction("globalThis.show");
  return page;
}

/** Gives files to the page, as if they were chosen, and returns what it says. */
async function choose(files, to = page) {
  const given = Object.entries(files).map(([name, bytes]) => [name, Buffer.from(bytes).toString("base64")]);
  await to.evaluate((given) => {
    const transfer = new DataTransfer();
    for (const [name, text] of given) {
      transfer.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
    }
    const input = document.querySelector("input");
    input.files = transfer.files;
    input.dispatchEvent(new Event("change"));
  }, given);
  return said(to);
}
async function said(page) {
  await page.waitForFunction("document.body.dataset.said");
  return page.evaluate(() => {
    const said = document.body.dataset.said;
    delete document.body.dataset.said;
    return { said, ...globalThis.open && { notes: globalThis.open.notes, parts: globalThis.open.parts.length, clip: globalThis.open.clip?.name } };
  });
}
const red = [190, 30, 30];
/** Strain of the discs, before and after, in the middle of a clip or at its end. */
const strain = (share = 0.99) => page.evaluate(async (red, share) => {
  await paint(red, 70);
  const [{ strain }] = await pose(share);
  draw();
  return [strain.before.rms, strain.after.rms];
}, red, share);

test("base", { skip, timeout }, async () => {
  console.log(await choose({ "sheet.glb": sheet().glb() }));
  console.log(await strain());
  writeFileSync("/tmp/base.png", await page.screenshot());
});
