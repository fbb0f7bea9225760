// Files of visitors: odd ones that are made here, and public characters of the folder VRTM_GLTF. `npm run page` comes
// first.
import assert from "node:assert/strict";
import { cpSync, existsSync, mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import { PNG } from "pngjs";
import { launch, serve, skip } from "./browser.mjs";
import { strainOf } from "./strain.mjs";
import { attributes, bytesOf, draco, meshopt, picture, sheet } from "./gltf.mjs";

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

/** What strainOf() needs of each part of what is open, from the page. */
async function measured(page) {
  const texts = await page.evaluate(() => character.parts.map(({ source, redirected, rigidity, size }) => {
    const { positions: rest, indices, uvs, uvIndices } = source.mesh;
    const { delta, mapSize } = redirected;
    const text = (array) => {
      const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
      return [array.constructor.name, Array.from({ length: Math.ceil(bytes.length / 3e4) }, (_, k) =>
        btoa(String.fromCharCode(...bytes.subarray(3e4 * k, 3e4 * (k + 1))))).join("")];
    };
    const arrays = { rest, pose: source.pose(), indices, uvs, uvIndices, rigidity, delta };
    return { size, mapSize, ...Object.fromEntries(Object.entries(arrays).map(([name, array]) => [name, text(array)])) };
  }));
  const read = ([kind, text]) => new globalThis[kind](new Uint8Array(Buffer.from(text, "base64")).buffer);
  return texts.map((part) => Object.fromEntries(Object.entries(part).map(([name, of]) => [name, Array.isArray(of) ? read(of) : of])));
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
/** Keeps a picture in the folder VRTM_SHOTS, to be looked at. */
async function keep(page, name) {
  const folder = process.env.VRTM_SHOTS;
  if (folder) {
    writeFileSync(join(folder, `${name.replaceAll(" ", "_")}.png`), await page.screenshot());
  }
}
const red = [190, 30, 30];
/** Strain of the discs at a share of the clip: the least before and the largest after of all parts. */
const strain = (share = 0.99) => page.evaluate(async (red, share) => {
  await paint(red, 70);
  const strains = (await pose(share)).map(({ strain }) => strain);
  draw();
  return [Math.min(...strains.map(({ before }) => before.rms)), Math.max(...strains.map(({ after }) => after.rms))];
}, red, share);

const float = (given, name, of) => ({ ...given, [name]: [given[name][0].map(of), given[name][1]] });
/** The sheet as other programs write it: its strain is always the same. */
const SAME = {
  quantised() {
    const model = sheet({ encode: (model, name, [array, size]) => {
      const kinds = { POSITION: [Int16Array, 32767], NORMAL: [Int8Array, 127], JOINTS_0: [Uint8Array, 1] };
      const [Kind, most] = kinds[name] ?? [Uint16Array, 65535];
      // Vertices begin at multiples of four bytes.
      const stride = Math.ceil((size * Kind.BYTES_PER_ELEMENT) / 4) * 4;
      const apart = stride / Kind.BYTES_PER_ELEMENT;
      const padded = new Kind((array.length / size) * apart);
      array.forEach((x, k) => (padded[Math.floor(k / size) * apart + (k % size)] = Math.round(most * x)));
      const k = model.accessor(padded, size, { count: array.length / size, normalized: most > 1 });
      model.json.bufferViews.at(-1).byteStride = stride;
      return k;
    } });
    model.uses("KHR_mesh_quantization");
    return model;
  },
  sparse: () => sheet({ encode: (model, name, [array, size]) => {
    if (name !== "POSITION") {
      return model.accessor(array, size);
    }
    // Every other place is in the base, the others are sparse.
    const k = model.accessor(array.map((x, n) => (Math.floor(n / 3) % 2 ? 0 : x)), size);
    const odd = Uint16Array.from({ length: Math.floor(array.length / 6) }, (_, n) => 2 * n + 1);
    const values = Float32Array.from([...odd].flatMap((n) => [...array.subarray(3 * n, 3 * n + 3)]));
    model.json.accessors[k].sparse = { count: odd.length, indices: { bufferView: model.view(bytesOf(odd)), componentType: 5123 },
      values: { bufferView: model.view(bytesOf(values)) } };
    return k;
  } }),
  interleaved() {
    const { POSITION: [positions], NORMAL: [normals], TEXCOORD_0: [uvs] } = attributes();
    const all = new Float32Array(8 * (uvs.length / 2));
    for (let v = 0; v < uvs.length / 2; v++) {
      all.set([...positions.subarray(3 * v, 3 * v + 3), ...normals.subarray(3 * v, 3 * v + 3), ...uvs.subarray(2 * v, 2 * v + 2)], 8 * v);
    }
    let view;
    return sheet({ encode: (model, name, [array, size]) => {
      const byteOffset = { POSITION: 0, NORMAL: 12, TEXCOORD_0: 24 }[name];
      view ??= model.view(bytesOf(all), { byteStride: 32 });
      return byteOffset === undefined ? model.accessor(array, size)
        : model.add("accessors", { bufferView: view, byteOffset, componentType: 5126, count: array.length / size, type: `VEC${size}` });
    } });
  },
  meshopt() {
    const model = sheet({ encode: (model, name, [array, size]) => {
      const [count, byteStride] = [array.length / size, size * array.BYTES_PER_ELEMENT];
      const bytes = meshopt(bytesOf(array), byteStride);
      const k = model.accessor(new array.constructor(array.length), size);
      model.view(bytes);
      const { byteOffset, byteLength } = model.json.bufferViews.pop();
      const extension = { buffer: 0, byteOffset, byteLength, byteStride, count, mode: "ATTRIBUTES" };
      model.json.bufferViews.at(-1).extensions = { EXT_meshopt_compression: extension };
      return k;
    } });
    model.uses("EXT_meshopt_compression");
    return model;
  },
  draco() {
    const names = ["POSITION", "NORMAL", "TEXCOORD_0", "JOINTS_0", "WEIGHTS_0"];
    const { index, ...given } = attributes();
    const model = sheet();
    const bytes = draco(index[0], names.map((name, k) => [[0, 1, 3, 4, 4][k], given[name]]));
    const ids = Object.fromEntries(names.map((name, k) => [name, k]));
    const [primitive] = model.json.meshes[0].primitives;
    primitive.extensions = { KHR_draco_mesh_compression: { bufferView: model.view(bytes), attributes: ids } };
    Object.values(primitive.attributes).concat(primitive.indices).forEach((k) => delete model.json.accessors[k].bufferView);
    model.uses("KHR_draco_mesh_compression");
    return model;
  },
  "its colour in the second UV set"() {
    const model = sheet({ change: ({ TEXCOORD_0, ...given }) =>
      ({ ...given, TEXCOORD_0: [new Float32Array(TEXCOORD_0[0].length), 2], TEXCOORD_1: TEXCOORD_0 }) });
    model.json.materials[0].pbrMetallicRoughness.baseColorTexture.texCoord = 1;
    return model;
  },
  "a texture transform"() {
    const model = sheet({ change: (given) => float(given, "TEXCOORD_0", (x) => 0.1 + 0.8 * x) });
    const transform = { offset: [-0.125, -0.125], scale: [1.25, 1.25] };
    model.json.materials[0].pbrMetallicRoughness.baseColorTexture.extensions = { KHR_texture_transform: transform };
    model.uses("KHR_texture_transform");
    return model;
  },
  "UVs three tiles away": () => sheet({ change: (given) => float(given, "TEXCOORD_0", (x, k) => (k % 2 ? x : x + 3)) }),
  "vertices split at each corner"() {
    const { index: [index], ...given } = attributes();
    const split = ([array, size]) =>
      [array.constructor.from([...index].flatMap((v) => [...array.subarray(size * v, size * v + size)])), size];
    return sheet({ change: () => ({ ...Object.fromEntries(Object.entries(given).map(([name, value]) => [name, split(value)])),
      index: [index.map((_, k) => k), 1] }) });
  },
  "a mirror and a morph target"() {
    const model = sheet({ moves: "morph" });
    Object.assign(model.json.nodes[0], { scale: [-3, 3, 3], rotation: [0, 0.6, 0, 0.8] });
    return model;
  },
  "cameras and lights"() {
    const model = sheet();
    model.add("cameras", { type: "perspective", perspective: { yfov: 1, znear: 0.1 } });
    model.json.extensions = { KHR_lights_punctual: { lights: [{ type: "point" }] } };
    model.json.extensionsUsed = ["KHR_lights_punctual"];
    model.json.scenes[0].nodes.push(model.add("nodes", { camera: 0, extensions: { KHR_lights_punctual: { light: 0 } } }));
    return model;
  },
  "an unlit material"() {
    const model = sheet();
    model.json.materials[0].extensions = { KHR_materials_unlit: {} };
    model.uses("KHR_materials_unlit");
    return model;
  },
};

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

/** Drops a file or folder of this machine on the page. */
async function drop(page, path) {
  const session = await page.createCDPSession();
  const data = { items: [], files: [path], dragOperationsMask: 1 };
  for (const type of ["dragEnter", "dragOver", "drop"]) {
    await session.send("Input.dispatchDragEvent", { type, x: 200, y: 300, data });
  }
}

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

/** Public characters: seconds of their clip, and a colour of their texture that keeps its shape. */
const PUBLIC = {
  "CesiumMan.gltf": [1, [92, 138, 40]],
  "Fox.glb": [1.7, [255, 250, 240]],
  "Soldier.glb": [2.6, [60, 95, 105]],
  "Michelle.glb": [14.6, [90, 190, 205]],
  "Crab.glb": [0.25, [40, 90, 120]],
};

for (const [width, height, memory] of [[390, 844, 4], [1280, 800, 8]]) {
  test(`public characters dropped on the page are painted by colour and play at ${width} x ${height}`, { skip, timeout }, async (t) => {
    const shell = skip || await serve(fileURLToPath(new URL("../../../examples/web/dist", import.meta.url)));
    const page = skip || await browser.newPage();
    for (const [name, [time, colour]] of Object.entries(PUBLIC)) {
      const path = join(process.env.VRTM_GLTF ?? "", name);
      const absent = !existsSync(path) && `${name} is not in the folder VRTM_GLTF`;
      await t.test(name, { skip: absent }, async () => {
        if (page.url() === "about:blank") {
          page.setDefaultTimeout(timeout);
          await page.evaluateOnNewDocument((memory) => Object.defineProperty(navigator, "deviceMemory", { value: memory }), memory);
          await page.setViewport({ width, height, hasTouch: memory < 8, isMobile: memory < 8 });
          await page.goto(shell.url);
          await page.waitForSelector("body[data-solved]");
        }
        await drop(page, path);
        await page.waitForFunction((name) => character?.name === name && document.body.dataset.solved, {}, name);
        await page.evaluate(() => document.body.dataset.state === "playing" || document.getElementById("play").click());
        const begun = await page.$eval("#time", ({ value }) => value);
        await page.waitForFunction((begun) => document.getElementById("time").value !== begun, {}, begun);
        assert.match(await page.$eval("#notes", ({ textContent }) => textContent), memory < 8 ? /256 × 256 cells/ : /512 × 512 cells/);
        await page.evaluate(async (time, colour) => {
          await Promise.all(character.parts.map(({ texture, rigidity, size, redirected }) => {
            rigidity.forEach((_, k) => {
              const away = Math.hypot(...colour.map((x, channel) => x - texture.data[4 * k + channel]));
              rigidity[k] = away < 50 ? 255 : 0;
            });
            return redirected.setRigidity(rigidity, size);
          }));
          const slider = document.getElementById("time");
          slider.value = time;
          slider.dispatchEvent(new Event("input"));
        }, time, colour);
        await page.waitForSelector("body[data-state=still][data-solved=normal]");
        await keep(page, `${name} ${width}`);
        const reports = await page.evaluate("character.parts.map(({ redirected }) => redirected.report.strain)");
        const parts = await measured(page);
        reports.forEach(({ before, after }, k) => {
          const own = strainOf({ ...parts[k], map: parts[k].mapSize });
          const told = JSON.stringify([before.rms, after.rms, own]);
          assert.ok(after.rms < 0.75 * before.rms && after.rms < 0.1, told);
          assert.ok(Math.abs(own.before - before.rms) < 0.25 * before.rms && Math.abs(own.after - after.rms) < 0.03, told);
          t.diagnostic(`${name}: ${told}`);
        });
      });
    }
    shell.server?.close();
  });
}
