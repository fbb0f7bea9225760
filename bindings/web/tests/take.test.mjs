// The page's downloads, from its buttons to files that other programs read: pngjs, three.js, Khronos's validator,
// and `vrtm bake` where VRTM_LIBRARY names a library, and VRTM_PYTHON a Python with what `vrtm[bake]` needs.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { cpSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import validator from "gltf-validator";
import { PNG } from "pngjs";
import { FloatType } from "three";
import { unzipSync } from "three/addons/libs/fflate.module.js";
import { EXRLoader } from "three/addons/loaders/EXRLoader.js";
import { launch, serve, skip } from "./browser.mjs";

const here = fileURLToPath(new URL("..", import.meta.url));
const folder = mkdtempSync(join(tmpdir(), "vrtm-take-"));
const timeout = 600_000;
const PARTS = ["Arm", "_1_Sheet"];
let browser, served, page, client;

before(async () => {
  if (skip) {
    return;
  }
  await build({
    entryPoints: { main: `${here}tests/take_page.js`, worker: `${here}dist/worker.js` },
    alias: { "vrtm/three": `${here}dist/three/index.js` },
    nodePaths: [`${here}node_modules`],
    bundle: true, ignoreAnnotations: true, format: "esm", target: "es2022", outdir: folder, logLevel: "error",
  });
  cpSync(`${here}dist/wasm/vrtm_bg.wasm`, join(folder, "vrtm_bg.wasm"));
  served = await serve(folder, '<!doctype html><script type="module" src="main.js"></script>');
  browser = await launch();
  page = await browser.newPage();
  page.on("pageerror", (error) => console.error(error));
  client = await browser.target().createCDPSession();
  await client.send("Browser.setDownloadBehavior", { behavior: "allow", downloadPath: folder, eventsEnabled: true });
  await page.goto(served.url, { timeout });
  await page.waitForFunction("window.open.parts", { timeout });
});
after(async () => {
  await browser?.close();
  served?.server.close();
  rmSync(folder, { recursive: true });
});

const press = (text) => page.$$eval("button", (all, text) => all.find((one) => one.textContent === text).click(), text);
const said = (words) =>
  page.waitForFunction((words) => document.querySelector("output").textContent.includes(words), { timeout }, words);
const solved = (...of) => page.evaluate((of) => window.solved(...of), of);
const farthest = (a, b) => a.reduce((most, x, k) => Math.max(most, Math.abs(x - b[k])), 0);

/** Presses a button, and returns the file that is downloaded, and the files in it. */
async function taken(text) {
  const done = new Promise((resolve) => {
    let begun;
    client.once("Browser.downloadWillBegin", (event) => (begun = event));
    client.on("Browser.downloadProgress", ({ guid, state }) =>
      guid === begun?.guid && state === "completed" && resolve(begun.suggestedFilename));
  });
  await press(text);
  const name = await done;
  const bytes = readFileSync(join(folder, name));
  return { name, bytes, files: name.endsWith(".zip") ? unzipSync(bytes) : {} };
}

/** Numbers of u and v of an EXR file, the first row at the top. */
function exr(bytes) {
  const { data, width, height } = new EXRLoader().setDataType(FloatType).parse(Uint8Array.from(bytes).buffer);
  const at = (k) => 4 * ((height - 1 - Math.floor(k / width)) * width + (k % width));
  return Float32Array.from({ length: 2 * width * height }, (_, k) => data[at(k >> 1) + (k & 1)]);
}

test("the map of the frame that is shown", { skip, timeout }, async () => {
  await page.evaluate(() => window.open.clip.mixer.setTime(5 / 24));
  const { files } = await taken("Map");
  for (const [p, name] of PARTS.entries()) {
    const expected = await solved(p, 6, "uv");
    assert.equal(farthest(expected, exr(files[`${name}.redirect.1001.exr`])), 0);
  }
});

test("basis maps: the sums of EXR files are the frames' maps, to the stated error", { skip, timeout }, async () => {
  const { files } = await taken("Basis maps");
  Object.entries(files).forEach(([name, bytes]) => writeFileSync(join(folder, name), bytes));
  for (const [p, name] of PARTS.entries()) {
    const document = JSON.parse(Buffer.from(files[`${name}.basis.json`]));
    const { maps, format, frames, files: [{ maps: names, size }] } = document;
    assert.ok(maps > 0 && maps < 7, `${maps} maps for 7 frames`);
    assert.deepEqual([format, size, frames.length, names.length], ["half", [256, 256], 7, maps]);
    const images = names.map((one) => exr(files[one]));
    for (const { frame, weights, error } of frames) {
      const delta = await solved(p, frame, "delta");
      const left = delta.map((x, k) => weights.reduce((sum, weight, n) => sum - weight * images[n][k], x));
      const off = 4096 * left.reduce((most, x, k) => (k % 2 ? most : Math.max(most, Math.hypot(x, left[k + 1]))), 0);
      assert.ok(off < 8.001 && Math.abs(off - error) < 0.01, `frame ${frame}: ${off}, ${error}`);
    }
  }
});

test("glTF is valid, and plays positions and UVs as the solver has them", { skip, timeout }, async () => {
  const { name, bytes } = await taken("glTF");
  assert.equal(name, "two_parts.basis.glb");
  const { issues, info } = await validator.validateBytes(bytes);
  assert.equal(issues.numErrors + issues.numWarnings, 0, JSON.stringify(issues.messages.slice(0, 5)));
  assert.ok(info.animationCount === 1 && info.materialCount === 2 && info.hasMorphTargets && info.hasTextures);
  const off = await page.evaluate((bytes) => window.played(bytes), [...bytes]);
  // UVs are off by the sums' 8 texels of 4096, and by 8 in the middle of edges; strips have 288 triangles each.
  assert.ok(off.positions < 5e-4 && 4096 * off.uvs < 16 && 4096 * off.own > 150, JSON.stringify(off));
  assert.ok(off.triangles > 1200, `${off.triangles} triangles`);
});

test("what is under way can be cancelled", { skip, timeout }, async () => {
  await press("glTF");
  await said("frame 2");
  await press("Cancel");
  await said("Cancelled.");
});

test("`vrtm bake` makes the page's maps of paint, motion and settings", { skip, timeout }, async (t) => {
  const { files } = await taken("For vrtm bake");
  const known = readFileSync(`${here}../python/src/vrtm/bake/arguments.py`, "utf8");
  const options = Buffer.from(files["bake.txt"]).toString().match(/--[a-z-]+/g);
  assert.deepEqual(options.filter((option) => !known.includes(`"${option}"`)), []);
  const { data } = PNG.sync.read(Buffer.from(files["Arm.rigidity.1001.png"]));
  const painted = await page.evaluate(() => [...window.open.parts[0].rigidity]);
  assert.equal(farthest(painted, painted.map((_, k) => data[4 * k])), 0);
  if (!process.env.VRTM_LIBRARY) {
    return t.diagnostic("VRTM_LIBRARY names no library: nothing was baked");
  }
  Object.entries(files).forEach(([name, bytes]) => writeFileSync(join(folder, name), bytes));
  const command = "-m vrtm.cli bake scene.usda --settings bake.txt --out maps --frames 1,4,7".split(" ");
  const env = { ...process.env, PYTHONPATH: `${here}../python/src` };
  execFileSync(process.env.VRTM_PYTHON ?? "python3", command, { cwd: folder, env });
  for (const [p, name] of PARTS.entries()) {
    const baked = exr(readFileSync(join(folder, "maps", `${name}.redirect.0007.1001.exr`)));
    assert.equal(farthest(await solved(p, 7, "uv"), baked), 0, name);
  }
});

test("a shader sums basis maps up, and draws what the solver's maps draw", { skip, timeout }, async () => {
  const files = PARTS.map((name) => `${name}.basis.json`);
  const { urls, ...means } = await page.evaluate((files) => window.drawn(files), files);
  if (process.env.VRTM_PICTURES) {
    urls.forEach((url, k) => writeFileSync(join(process.env.VRTM_PICTURES, `${k}.png`), url.split(",")[1], "base64"));
  }
  const { own, basis, rest, disposed } = means;
  assert.ok(own > 0.5 && basis < 0.01 * own && rest < 0.01 && disposed === 0, JSON.stringify(means));
});
