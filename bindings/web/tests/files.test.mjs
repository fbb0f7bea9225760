// Files of visitors: odd ones that are made here.
import assert from "node:assert/strict";
import { cpSync, mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import { drop, keep, launch, serve, skip } from "./browser.mjs";
import { attributes, picture, sheet } from "./gltf.mjs";
import { SAME, float } from "./odd.mjs";

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
    const { notes, parts, clip } = globalThis.open.parts ? globalThis.open : { parts: [] };
    return { said, notes, parts: parts.length, clip: clip?.name };
  });
}
const red = [190, 30, 30];
/** Strain of the discs at a share of the clip: the least before and the largest after of all parts. */
const strain = (share = 0.99) => page.evaluate(async (red, share) => {
  await paint(red, 70);
  const strains = (await pose(share)).map(({ strain }) => strain);
  draw();
  return [Math.min(...strains.map(({ before }) => before.rms)), Math.max(...strains.map(({ after }) => after.rms))];
}, red, share);

test("files say the same in many ways", { skip, timeout }, async (t) => {
  assert.equal((await choose({ "sheet.glb": sheet().glb() })).said, "open");
  const [before, after] = await strain();
  assert.ok(before > 0.3 && after < 0.02, `${before} -> ${after}`);
  for (const [name, make] of Object.entries(SAME)) {
    await t.test(name, async () => {
      const { said, parts, notes } = await choose({ "sheet.glb": make().glb() });
      assert.deepEqual([said, parts, notes.length], ["open", 1, 1], `${notes}`);
      const found = await strain(name.includes("morph") ? 0.5 : 0.99);
      assert.ok(Math.abs(found[0] - before) < 0.02 && found[1] < 0.02, `${found}`);
      await keep(page, name);
    });
  }
});

const separate = (model) => {
  const { json, bin } = model.parts("buffers/sheet.bin");
  return { "sheet.gltf": json, "sheet.bin": bin };
};
const changed = (change, options) => {
  const model = sheet(options);
  change(model.json);
  return { "odd.glb": model.glb() };
};
/** Files that cannot be opened, and what is said of them. */
const REFUSED = [
  ["another format", () => ({ "notes.txt": "a" }), /^notes.txt is no glTF/],
  ["no JSON", () => ({ "odd.gltf": "{" }), /^odd.gltf is broken, or not whole/],
  ["half a file", () => ({ "odd.glb": sheet().glb().subarray(0, 6000) }), /^odd.glb is broken, or not whole/],
  ["glTF 1", () => changed((json) => (json.asset.version = "1.0")), /odd.glb is broken.*2\.0/],
  ["a missing buffer", () => ({ "sheet.gltf": separate(sheet())["sheet.gltf"] }), /^sheet.gltf needs buffers\/sheet.bin: drop all/],
  ["an unknown extension", () => changed((json) => (json.extensionsUsed = json.extensionsRequired = ["ACME_voxels"])),
    /^odd.glb needs ACME_voxels, which/],
  ["too many vertices", () => changed((json) => (json.accessors[1].count = 9e6)), /odd.glb has 9,000,000 vertices: this device opens up to 500,000 vertices\.$/],
  ["lines", () => changed((json) => (json.meshes[0].primitives[0].mode = 1)), /^It has no mesh: points, lines/],
  ["no mesh", () => changed((json) => (json.scenes[0].nodes = [1, 2])), /^It has no mesh/],
  ["no UVs", () => changed((json) => delete json.meshes[0].primitives[0].attributes.TEXCOORD_0), /^It has no UVs/],
  ["UVs in one place", () => ({ "odd.glb": sheet({ change: (given) => float(given, "TEXCOORD_0", () => 0.5) }).glb() }), /^It has no UVs/],
  ["numbers that are none", () => ({ "odd.glb": sheet({ change: (given) => float(given, "POSITION", () => NaN) }).glb() }), /positions/],
  ["bones that are not there", () => changed((json) => json.skins[0].joints.pop()), /bones that it does not have/],
];
/** Files that open, with what is said of them: parts, clip and a note. */
const OPENED = [
  ["buffers and images beside it", () => {
    const model = sheet({ image: { uri: "./textures/red%20discs.png" } });
    return { ...separate(model), "red discs.png": picture() };
  }, 1, "stretch", /^For this device/],
  ["a missing image", () => separate(sheet({ image: { uri: "discs.png" } })), 1, "stretch", /^Without discs.png: drop/],
  ["a broken image", () => changed((json) => (json.images = [{ uri: "data:image/png;base64,AAAA" }])),
    1, "stretch", /^1 of its textures cannot be read/],
  ["no textures", () => changed((json) => delete json.materials[0].pbrMetallicRoughness.baseColorTexture),
    1, "stretch", /no textures: it is shown with a pattern/],
  ["nothing that moves", () => ({ "odd.glb": sheet({ moves: "nothing" }).glb() }), 1, undefined, /it does not move/],
  ["morph targets without a clip", () => ({ "odd.glb": sheet({ moves: "morph" }).glb() }), 1, "morph targets in turn", /^For this device/],
  ["a second mesh without UVs", () => changed((json) => {
    const { attributes: { TEXCOORD_0, ...attributes }, ...primitive } = json.meshes[0].primitives[0];
    json.meshes[0].primitives.push({ ...primitive, attributes });
  }), 1, "stretch", /^1 of its 2 meshes have no UVs/],
  ["a twin that has its place in the texture", () => {
    const model = sheet();
    const [primitive] = model.json.meshes[0].primitives;
    const POSITION = model.accessor(attributes().POSITION[0].map((x, k) => (k % 3 === 1 ? x - 1.1 : x)), 3);
    model.json.meshes[0].primitives.push({ ...primitive, attributes: { ...primitive.attributes, POSITION } });
    return { "twin.glb": model.glb() };
  }, 2, "stretch", /^For this device/],
  ["several skins", () => changed((json) => {
    json.skins.push({ joints: [2, 1] });
    json.scenes[0].nodes.push(json.nodes.push({ mesh: 0, skin: 1 }) - 1);
  }), 2, "stretch", /^For this device/],
];

test("what cannot be opened is told in a sentence, and leaves what is open", { skip, timeout }, async (t) => {
  await choose({ "first.glb": sheet().glb() });
  for (const [name, make, sentence] of REFUSED) {
    await t.test(name, async () => {
      assert.match((await choose(make())).said, sentence);
      assert.equal(await page.evaluate("open.name"), "first.glb");
      const [before, after] = await strain();
      assert.ok(before > 0.3 && after < 0.02, `${before} -> ${after}`);
    });
  }
});

test("what opens in part is told, too", { skip, timeout }, async (t) => {
  for (const [name, make, parts, clip, note] of OPENED) {
    await t.test(name, async () => {
      const { said, notes, ...found } = await choose(make());
      assert.deepEqual([said, found.parts, found.clip], ["open", parts, clip]);
      assert.ok(notes.some((each) => note.test(each)), `${notes}`);
      const [before, after] = await strain(clip === "stretch" ? 0.99 : 0.5);
      // The pattern has other discs.
      assert.ok(notes.some((note) => /pattern/.test(note)) || !clip || (before > 0.25 && after < before / 4), `${before} -> ${after}`);
      await keep(page, name);
    });
  }
});

test("a folder is dropped, with buffers and images in folders of their own", { skip, timeout }, async () => {
  const model = sheet({ image: { uri: "../textures/red%20discs.png" } });
  const { json, bin } = model.parts("../buffers/sheet.bin");
  const files = { "scene/sheet.gltf": json, "buffers/sheet.bin": bin, "textures/red discs.png": picture(), "sheet.bin": "another" };
  for (const [name, bytes] of Object.entries(files)) {
    mkdirSync(dirname(join(folder, "dropped", name)), { recursive: true });
    writeFileSync(join(folder, "dropped", name), bytes);
  }
  await drop(page, join(folder, "dropped"));
  assert.deepEqual(await said(page).then(({ said, notes, clip }) => [said, notes.length, clip]), ["open", 1, "stretch"]);
  const [before, after] = await strain();
  assert.ok(before > 0.3 && after < 0.02, `${before} -> ${after}`);
});

test("fifty files and a thousand poses leave nothing behind", { skip, timeout }, async () => {
  const page = await opened({ width: 480, height: 360 });
  const session = await page.createCDPSession();
  const rest = async () => {
    const counted = await page.evaluate("pose(1, 'draft').then(() => ({ ...draw(), ...counts }))");
    await session.send("HeapProfiler.collectGarbage");
    return { ...counted, bytes: (await page.metrics()).JSHeapUsedSize };
  };
  const names = Object.keys(SAME);
  const open = async (k) => {
    const model = SAME[names[k % names.length]]();
    assert.equal((await choose(k % 5 ? { "sheet.glb": model.glb() } : separate(model), page)).said, "open");
  };
  const states = [];
  for (let k = 0; k < 50; k++) {
    await open(k);
    await page.evaluate("pose(0.5, 'draft').then(() => draw())");
    if (k === 4 || k === 49) {
      await open(0);
      states.push(await rest());
    }
  }
  await page.evaluate(async () => {
    for (let k = 0; k < 1000; k++) {
      await pose((k % 100) / 100, "draft");
    }
  });
  states.push(await rest());
  for (const { bytes, ...counted } of states) {
    const { bytes: first, ...expected } = states[0];
    assert.deepEqual(counted, expected);
    assert.ok(bytes < first + 5e6, `${first} bytes, then ${bytes}`);
  }
  assert.deepEqual([states[0].workers, states[0].urls], [1, 0]);
});
