// Files of visitors: odd ones that are made here, and public characters of the folder VRTM_GLTF.
import assert from "node:assert/strict";
import { existsSync, mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { after, test } from "node:test";
import { PHONE, WIDE, drop, keep, options, pages, seek } from "./browser.mjs";
import { attributes, picture, sheet } from "./gltf.mjs";
import { SAME, float } from "./odd.mjs";
import { strains } from "./strain.mjs";

let page;
const inPage = pages(async () => {
  page = await opened({ width: 480, height: 360 }, 4);
});
const folder = mkdtempSync(join(tmpdir(), "vrtm-files-"));
after(() => rmSync(folder, { recursive: true }));
/** Opens the page on a device of so much memory, where nothing moves by itself; it counts what it makes. */
const opened = (viewport, memory) => inPage(viewport, { first: async (page) => {
  await page.emulateMediaFeatures([{ name: "prefers-reduced-motion", value: "reduce" }]);
  await page.evaluateOnNewDocument((memory) => {
    Object.defineProperty(navigator, "deviceMemory", { value: memory });
    const counts = (globalThis.counts = { urls: 0, gpu: 0 });
    const count = (object, name, method, by) => {
      const call = object[method];
      object[method] = function (...given) {
        counts[name] += by;
        return call.apply(this, given);
      };
    };
    count(URL, "urls", "createObjectURL", 1);
    count(URL, "urls", "revokeObjectURL", -1);
    for (const kind of ["Texture", "Buffer", "Program", "Framebuffer", "VertexArray"]) {
      count(WebGL2RenderingContext.prototype, "gpu", `create${kind}`, 1);
      count(WebGL2RenderingContext.prototype, "gpu", `delete${kind}`, -1);
    }
  }, memory);
} });

/** Gives files to the page, and returns what it says and has then. */
async function choose(files, to = page) {
  const given = Object.entries(files).map(([name, bytes]) => [name, Buffer.from(bytes).toString("base64")]);
  return said(to, () => to.evaluate((given) => {
    const transfer = new DataTransfer();
    for (const [name, text] of given) {
      transfer.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
    }
    const input = document.getElementById("file");
    input.files = transfer.files;
    input.dispatchEvent(new Event("change"));
  }, given));
}
async function said(page, act) {
  const before = await page.evaluateHandle("character");
  await page.evaluate(() => document.body.click());
  await act();
  await page.waitForFunction((before) => document.querySelector("#message.error")
    || (character !== before && document.body.dataset.solved === "normal"), {}, before);
  return page.evaluate(() => {
    const { notes, parts: { length: parts }, clip } = character;
    return { said: document.querySelector("#message.error")?.textContent ?? "open", notes, parts, clip: clip?.name };
  });
}

/** Makes a colour rigid, and nothing else. */
const paint = (page, colour, most) => page.evaluate((colour, most) =>
  Promise.all(character.parts.map(({ texture, rigidity, size, redirected }) => {
    rigidity.forEach((_, k) => {
      const away = Math.hypot(...colour.map((x, channel) => x - texture.data[4 * k + channel]));
      rigidity[k] = away < most ? 255 : 0;
    });
    return redirected.setRigidity(rigidity, size);
  })), colour, most);

/** Strain of the discs at a share of the clip: the least before and the largest after of all parts. */
async function strain(share = 0.99) {
  await paint(page, [190, 30, 30], 70);
  await seek(page, await page.evaluate((share) => share * (character.clip?.duration ?? 0), share));
  const strains = await page.evaluate("character.parts.map(({ redirected }) => redirected.report.strain)");
  return [Math.min(...strains.map(({ before }) => before.rms)), Math.max(...strains.map(({ after }) => after.rms))];
}

test("files say the same in many ways", options, async (t) => {
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
const floats = (name, x) => changed(() => {}, { change: (given) => float(given, name, () => x) });
/** Files that cannot be opened, and what is said of them. */
const REFUSED = [
  ["another format", () => ({ "notes.txt": "a" }), /^notes.txt is no glTF/],
  ["no JSON", () => ({ "odd.gltf": "{" }), /^odd.gltf is broken, or not whole/],
  ["half a file", () => ({ "odd.glb": sheet().glb().subarray(0, 6000) }), /^odd.glb is broken, or not whole/],
  ["glTF 1", () => changed((json) => (json.asset.version = "1.0")), /odd.glb is broken.*2\.0/],
  ["a missing buffer", () => ({ "sheet.gltf": separate(sheet())["sheet.gltf"] }),
    /^sheet.gltf needs buffers\/sheet.bin: drop all/],
  ["an unknown extension", () => changed((json) => (json.extensionsUsed = json.extensionsRequired = ["ACME_voxels"])),
    /^odd.glb needs ACME_voxels, which/],
  ["too many vertices", () => changed((json) => (json.accessors[1].count = 9e6)),
    /odd.glb has 9,000,000 vertices: this device opens up to 150,000 vertices\.$/],
  ["lines", () => changed((json) => (json.meshes[0].primitives[0].mode = 1)), /^It has no mesh: points, lines/],
  ["no mesh", () => changed((json) => (json.scenes[0].nodes = [1, 2])), /^It has no mesh/],
  ["no UVs", () => changed((json) => delete json.meshes[0].primitives[0].attributes.TEXCOORD_0), /^It has no UVs/],
  ["UVs in one place", () => floats("TEXCOORD_0", 0.5), /^It has no UVs/],
  ["numbers that are none", () => floats("POSITION", NaN), /positions/],
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
  ["morph targets without a clip", () => changed(() => {}, { moves: "morph" }),
    1, "morph targets in turn", /^For this device/],
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

test("what cannot be opened is told in a sentence, and leaves what is open", options, async (t) => {
  await choose({ "first.glb": sheet().glb() });
  for (const [name, make, sentence] of REFUSED) {
    await t.test(name, async () => {
      assert.match((await choose(make())).said, sentence);
      assert.equal(await page.evaluate("character.name"), "first.glb");
    });
  }
  const [before, after] = await strain();
  assert.ok(before > 0.3 && after < 0.02, `${before} -> ${after}`);
});

test("what opens in part is told, too", options, async (t) => {
  for (const [name, make, parts, clip, note] of OPENED) {
    await t.test(name, async () => {
      const { said, notes, ...found } = await choose(make());
      assert.deepEqual([said, found.parts, found.clip], ["open", parts, clip]);
      assert.ok(notes.some((each) => note.test(each)), `${notes}`);
      const [before, after] = await strain(clip === "stretch" ? 0.99 : 0.5);
      // The pattern has other discs.
      const isOther = !clip || notes.some((note) => /pattern/.test(note));
      assert.ok(isOther || (before > 0.25 && after < before / 4), `${before} -> ${after}`);
      await keep(page, name);
    });
  }
});

test("a folder is dropped, with buffers and images in folders of their own", options, async () => {
  const { json, bin } = sheet({ image: { uri: "../textures/red%20discs.png" } }).parts("../buffers/sheet.bin");
  const files = {
    "scene/sheet.gltf": json, "buffers/sheet.bin": bin, "textures/red discs.png": picture(), "sheet.bin": "another",
  };
  for (const [name, bytes] of Object.entries(files)) {
    mkdirSync(dirname(join(folder, name)), { recursive: true });
    writeFileSync(join(folder, name), bytes);
  }
  const { notes, clip } = await said(page, () => drop(page, folder));
  assert.deepEqual([notes.length, clip], [1, "stretch"]);
  assert.ok(await page.$eval("#drop", (zone) => zone.hidden), "the place to drop files covers what is open");
  const [before, after] = await strain();
  assert.ok(before > 0.3 && after < 0.02, `${before} -> ${after}`);
});

test("fifty files and a thousand poses leave nothing behind", options, async () => {
  const page = await opened({ width: 480, height: 360 }, 4);
  const session = await page.createCDPSession();
  const names = Object.keys(SAME);
  const open = async (k) => {
    const model = SAME[names[k % names.length]]();
    assert.equal((await choose(k % 5 ? { "sheet.glb": model.glb() } : separate(model), page)).said, "open");
  };
  const states = [];
  const rest = async () => {
    await open(0);
    await seek(page, 0.5);
    await session.send("HeapProfiler.collectGarbage");
    const { JSHeapUsedSize: bytes } = await page.metrics();
    states.push({ ...(await page.evaluate("counts")), workers: page.workers().length, bytes });
  };
  for (let k = 0; k < 50; k++) {
    await open(k);
    await (k === 4 || k === 49 ? rest() : undefined);
  }
  await page.evaluate(async () => {
    const { clip: { mixer }, parts: [{ redirected }] } = character;
    for (let k = 0; k < 1000; k++) {
      mixer.setTime((k % 100) / 100);
      await redirected.update("draft");
    }
  });
  await rest();
  const [{ bytes: first, ...expected }] = states;
  assert.deepEqual([expected.workers, expected.urls], [1, 0]);
  for (const { bytes, ...counted } of states) {
    assert.deepEqual(counted, expected);
    assert.ok(bytes < first + 5e6, `${first} bytes, then ${bytes}`);
  }
});

/** Public characters: seconds of their clip, and a colour of their texture that keeps its shape. */
const PUBLIC = {
  "CesiumMan.gltf": [1, [92, 138, 40]],
  "Fox.glb": [1.7, [255, 250, 240]],
  "Soldier.glb": [2.6, [60, 95, 105]],
  "Michelle.glb": [14.6, [90, 190, 205]],
  "Crab.glb": [0.25, [40, 90, 120]],
};

for (const [viewport, memory, cells] of [[PHONE, 4, 256], [WIDE, 8, 512]]) {
  test(`public characters, painted by colour, at ${viewport.width} x ${viewport.height}`, options, async (t) => {
    let page;
    for (const [name, [time, colour]] of Object.entries(PUBLIC)) {
      const path = join(process.env.VRTM_GLTF ?? "", name);
      await t.test(name, { skip: !existsSync(path) && `${name} is not in the folder VRTM_GLTF` }, async () => {
        page ??= await opened(viewport, memory);
        const { notes } = await said(page, () => drop(page, path));
        assert.ok(notes.join().includes(`${cells} × ${cells} cells`), `${notes}`);
        await page.$eval("#play", (button) => button.click());
        await page.waitForFunction(() => document.getElementById("time").value > 0.05);
        await paint(page, colour, 50);
        await seek(page, time);
        await keep(page, `${name} ${viewport.width}`);
        const reports = await page.evaluate("character.parts.map(({ redirected }) => redirected.report.strain)");
        (await strains(page)).forEach((own, k) => {
          const { before, after } = reports[k];
          const told = JSON.stringify([before.rms, after.rms, own]);
          const apart = [own.before - before.rms, own.after - after.rms].map(Math.abs);
          assert.ok(after.rms < 0.75 * before.rms && after.rms < 0.1, told);
          assert.ok(apart[0] < 0.25 * before.rms && apart[1] < 0.03, told);
          t.diagnostic(`${name}: ${told}`);
        });
      });
    }
  });
}
