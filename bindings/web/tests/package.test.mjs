// The package in Node: the bits of the library, and errors that name the argument. `npm run build` comes first.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { PNG } from "pngjs";

import { readObj } from "../../../examples/web/src/obj.js";
import { Asset, load } from "../dist/index.js";
import { WorkerAsset } from "../dist/worker_asset.js";

const root = fileURLToPath(new URL("../../..", import.meta.url));
const folder = mkdtempSync(join(tmpdir(), "vrtm-web-"));
after(() => rmSync(folder, { recursive: true }));
before(() => load());

/** A built-in scene, from the files that the example `scene` writes. */
function scene(name) {
  execFileSync("cargo", ["run", "--quiet", "--example", "scene", "--", name, join(folder, name)], {
    cwd: root,
  });
  const read = (file) => readFileSync(join(folder, name, file));
  const mesh = readObj(read("rest.obj").toString());
  const about = JSON.parse(read("asset.json"));
  const poses = new Float32Array(new Uint8Array(read("frames.f32")).buffer);
  const maps = Object.entries(about.rigidity).map(([udim, file]) => {
    const { width, height, data } = PNG.sync.read(read(file));
    return { udim: Number(udim), width, height, values: data.filter((_, k) => k % 4 === 0) };
  });
  return { mesh, maps, last: poses.slice(-mesh.positions.length) };
}

function hash(bytes) {
  let hash = 0x811c9dc5;
  for (const byte of bytes) {
    hash = Math.imul(hash ^ byte, 0x01000193);
  }
  return (hash >>> 0).toString(16).padStart(8, "0");
}

const options = { draft: { quality: "draft" }, normal: {}, warm: { warm: true } };

test("maps have the library's bits", () => {
  const lines = readFileSync(new URL("bits.txt", import.meta.url), "utf8").split("\n").filter((line) => /^\w/.test(line));
  assert.equal(lines.length, 9);
  const assets = {};
  for (const line of lines) {
    const [name, effort, expected] = line.split(" | ");
    assets[name] ??= (() => {
      const { mesh, maps, last } = scene(name);
      const asset = new Asset(mesh);
      for (const { udim, width, height, values } of maps) {
        asset.setRigidity(asset.tiles.findIndex((tile) => tile.udim === udim), values, width, height);
      }
      asset.tiles.forEach((_, tile) => asset.setSettings(tile, { grid: 128 }));
      return { asset, last };
    })();
    const { asset, last } = assets[name];
    asset.solve(last, options[effort]);
    const images = asset.tiles.map((_, tile) => Buffer.from(asset.fetch(tile, "uv", 96, 96).buffer));
    assert.equal(hash(Buffer.concat(images)), expected, line);
  }
});

/** Two squares side by side, with a feature in their middle. */
function squares() {
  const mesh = {
    positions: new Float32Array([0, 0, 0, 1, 0, 0, 2, 0, 0, 0, 1, 0, 1, 1, 0, 2, 1, 0]),
    faceCounts: new Uint32Array([4, 4]),
    indices: new Uint32Array([0, 1, 4, 3, 1, 2, 5, 4]),
    uvs: new Float32Array([0, 0, 0.5, 0, 1, 0, 0, 1, 0.5, 1, 1, 1]),
    uvIndices: new Uint32Array([0, 1, 4, 3, 1, 2, 5, 4]),
  };
  const values = new Uint8Array(32 * 32).map((_, k) => (k % 32 >= 12 && k % 32 < 20 && k >= 12 * 32 && k < 20 * 32 ? 255 : 0));
  const pose = mesh.positions.map((x, k) => (k === 3 || k === 12 ? 1.3 : x));
  return { mesh, values, pose };
}

test("a feature keeps its shape, and the report says so", () => {
  const { mesh, values, pose } = squares();
  const asset = new Asset(mesh);
  assert.deepEqual(asset.tiles.map(({ udim, layer, uvSet }) => [udim, layer, uvSet]), [[1001, 0, 0]]);
  asset.setRigidity(0, values, 32, 32);
  asset.solve(pose, { measure: true });
  const { strain, minJacobian, folds, truncated } = asset.report(0);
  assert.ok(strain.after.rms < 0.02 && strain.before.rms > 0.2, JSON.stringify(strain));
  assert.ok(strain.features > 0 && strain.featuresStrainedBefore > 0 && strain.featuresStrainedAfter === 0);
  assert.ok(strain.worst.length === strain.featuresWorse, JSON.stringify(strain));
  assert.ok(minJacobian > 0 && folds === 0 && !truncated);
  const delta = asset.fetch(0, "delta", 32, 32);
  const uv = asset.fetch(0, "uv", 32, 32);
  const k = 16 * 32 + 16;
  assert.ok(Math.abs(uv[2 * k] - delta[2 * k] - 16.5 / 32) < 1e-6);
  const half = asset.fetchHalf(0, "delta", 32, 32);
  assert.ok(half instanceof Uint16Array && half.length === 2 * 32 * 32 && half[2 * k] !== 0);
  assert.ok(asset.cornerUvs().length === 16);
  // A stroke alone, and all of it.
  const painted = values.slice().fill(255, 0, 4 * 32);
  asset.updateRigidity(0, painted, 32, 32, [0, 0, 32, 4]);
  asset.solve(pose);
  const stroked = asset.fetch(0, "uv", 32, 32);
  asset.setRigidity(0, painted, 32, 32);
  asset.solve(pose);
  assert.deepEqual(asset.fetch(0, "uv", 32, 32), stroked);
  asset.free();
});

test("errors name the argument, and nothing is lost", () => {
  const { mesh, values, pose } = squares();
  const asset = new Asset(mesh);
  asset.setRigidity(0, values, 32, 32);
  asset.solve(pose);
  const uvs = asset.fetch(0, "uv", 32, 32);
  const wrong = [
    [() => new Asset({}), "mesh.positions: it is missing"],
    [() => new Asset({ ...mesh, positons: 1 }), "mesh.positons: there is no such field"],
    [() => new Asset({ ...mesh, indices: [0, 1, 2] }), "mesh.indices: a typed array is expected"],
    [() => new Asset({ ...mesh, indices: new Uint16Array(8) }), "mesh.indices: a Uint32Array is expected"],
    [() => new Asset({ ...mesh, uvs: new Float32Array(11) }), "mesh.uvs: 11 numbers are no multiple of 2"],
    [() => asset.setRigidity(0, values, 32, 31), "values: 1024 values for 32 x 31 texels"],
    [() => asset.setRigidity(7, values, 32, 32), /tile: index 7/],
    [() => asset.setRigidity(0, new Float32Array([Number.NaN]), 1, 1), /is NaN/],
    [() => asset.solve(pose, { quality: "best" }), "options.quality: 'best' is not one of draft, normal"],
    [() => asset.solve(pose, { timeBudget: -1 }), "options.timeBudget: -1 is no time in milliseconds"],
    [() => asset.solve(pose, { warm: 1 }), "options.warm: true or false is expected"],
    [() => asset.solve(pose.slice(3)), "positions: 5 elements, but the mesh has 6 vertices"],
    [() => asset.solve(new Int32Array(18)), "positions: a typed array is expected"],
    [() => asset.setSettings(0, { smoothness: -1 }), /settings.smoothness: -1 is not between/],
    [() => asset.setSettings(0, { room_threshold: 1 }), "settings.room_threshold: there is no such field"],
    [() => asset.fetch(0, "UV", 8, 8), "kind: 'UV' is not uv, delta, udim or warp"],
    [() => asset.fetch(0, "uv", 0, 8), /image/],
    [() => asset.updateRigidity(0, values, 32, 32, [30, 0, 4, 4]), /rigidity/],
  ];
  for (const [call, message] of wrong) {
    assert.throws(call, { name: "InvalidArgument", message }, String(call));
  }
  assert.throws(() => new Asset(mesh).fetch(0, "uv", 8, 8), { name: "NotSolved" });
  assert.deepEqual(asset.fetch(0, "uv", 32, 32), uvs);
});

test("of the poses that wait for a worker the last one alone is solved", async () => {
  const asked = [];
  const worker = { postMessage: (question) => asked.push(question), terminate() {} };
  const answer = (value) => worker.onmessage({ data: { id: asked.at(-1).id, ...value } });
  const created = WorkerAsset.create(squares().mesh, { worker });
  answer({ value: [{ udim: 1001 }] });
  const asset = await created;
  assert.equal(asset.tiles[0].udim, 1001);

  const pose = (x) => new Float32Array([x]);
  const [first, second, third] = [1, 2, 3].map((x) => asset.redirect(pose(x), {}, []));
  assert.equal(asked.length, 2);
  assert.equal(await second, null);
  answer({ value: { images: [], reports: [1] } });
  assert.deepEqual((await first).reports, [1]);
  await new Promise(setImmediate);
  assert.deepEqual([asked.length, asked[2].positions[0]], [3, 3]);
  answer({ error: { name: "InvalidArgument", message: "positions: no" } });
  await assert.rejects(third, { name: "InvalidArgument", message: "positions: no" });

  // What is under way, and what waits, ends with the worker.
  const ends = [asset.redirect(pose(4), {}, []), asset.redirect(pose(5), {}, []), asset.cornerUvs()];
  asset.free();
  for (const end of ends) {
    await assert.rejects(end, /the asset was freed/);
  }
});
