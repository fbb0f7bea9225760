// The package in Node, in its thread and in a worker: the bits of the library, and errors that name the argument.
// `npm run build` comes first.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { PNG } from "pngjs";

import { Asset, AssetMethods, Carrier, VrtmError, load } from "../dist/index.js";
import { WorkerAsset } from "../dist/worker_asset.js";
import { Thread, squares } from "./shared.mjs";

const root = fileURLToPath(new URL("../../..", import.meta.url));
const folder = mkdtempSync(join(tmpdir(), "vrtm-web-"));
after(() => rmSync(folder, { recursive: true }));
before(async () => {
  assert.throws(() => new Asset(squares().mesh), { code: "NotLoaded", message: /load\(\) comes first/ });
  await assert.rejects(load(new Uint8Array(8)), { code: "NotLoaded", message: /cannot be loaded/ });
  await load();
});

after(() => Thread.all.forEach((thread) => thread.terminate()));

/** Both classes: a caller who awaits does not see which one it has. */
const classes = {
  Asset: (mesh, settings) => new Asset(mesh, settings),
  WorkerAsset: (mesh, settings) => WorkerAsset.create(mesh, { worker: new Thread(), ...settings }),
};
/** The same test of each of them. */
const both = (name, run) =>
  Object.entries(classes).forEach(([kind, create]) => test(`${kind}: ${name}`, () => run(create)));
const rejects = (call, expected) => assert.rejects(async () => call(), expected, String(call));
const close = (a, b, tolerance, what) => {
  assert.equal(a.length, b.length, what);
  a.forEach((x, k) => assert.ok(Math.abs(x - b[k]) <= tolerance, `${what} ${k}: ${x}, not ${b[k]}`));
};

/** A built-in scene, from the files that the example `scene` writes. */
function scene(name) {
  execFileSync("cargo", ["run", "--quiet", "--example", "scene", "--", name, join(folder, name)], { cwd: root });
  const read = (file) => readFileSync(join(folder, name, file));
  const rows = (key) => read("rest.obj").toString().split("\n").filter((line) => line.startsWith(`${key} `))
    .map((line) => line.trim().split(" ").slice(1));
  const faces = rows("f");
  const corners = faces.flat().map((corner) => corner.split("/").map((n) => n - 1));
  const mesh = {
    positions: Float32Array.from(rows("v").flat()), uvs: Float32Array.from(rows("vt").flat()),
    faceCounts: Uint32Array.from(faces, ({ length }) => length),
    indices: Uint32Array.from(corners, ([vertex]) => vertex), uvIndices: Uint32Array.from(corners, ([, uv]) => uv),
  };
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

const helped = (mesh) => WorkerAsset.create(mesh, { worker: new Thread(), helpers: [new Thread(), new Thread()] });
[classes.Asset, helped].forEach((create) => test(`maps have the library's bits, ${create.name}`, async () => {
  const lines = readFileSync(new URL("bits.txt", import.meta.url), "utf8").match(/^\w.*/gm);
  assert.equal(lines.length, 9);
  const assets = {};
  for (const line of lines) {
    const [name, effort, expected] = line.split(" | ");
    assets[name] ??= await (async () => {
      const { mesh, maps, last } = scene(name);
      const asset = await create(mesh);
      for (const { udim, width, height, values } of maps) {
        await asset.setRigidity(asset.tiles.findIndex((tile) => tile.udim === udim), values, width, height);
      }
      await Promise.all(asset.tiles.map((_, tile) => asset.setSettings(tile, { grid: 128 })));
      return { asset, last };
    })();
    const { asset, last } = assets[name];
    await asset.solve(last, options[effort]);
    const images = await Promise.all(asset.tiles.map((_, tile) => asset.fetch(tile, "uv", 96, 96)));
    assert.equal(hash(Buffer.concat(images.map((image) => Buffer.from(image.buffer)))), expected, line);
  }
}));

test("an asset ends with a helper, by whatever comes from it", async () => {
  const helper = new Thread();
  const asset = await WorkerAsset.create(squares().mesh, { worker: new Thread(), helpers: [helper] });
  helper.emit("error", new Error("a defect"));
  await rejects(() => asset.grid(0), { code: "WorkerEnded", message: /a defect/ });
});

both("a feature keeps its shape, and the report says so", async (create) => {
  const { mesh, values, pose } = squares();
  const asset = await create(mesh);
  assert.deepEqual(asset.tiles, [{ udim: 1001, uvSet: 0, layer: 0 }]);
  await asset.setSettings(0, { grid: 48 });
  assert.deepEqual(await asset.grid(0), [48, 48]);
  await asset.setSettings(0, { grid: 0 });
  await asset.setRigidity(0, values, 32, 32);
  await asset.solve(pose, { measure: true });
  const { strain, minJacobian, folds, truncated, grid } = await asset.report(0);
  assert.deepEqual(await asset.grid(0), grid);
  assert.ok(strain.after.rms < 0.02 && strain.before.rms > 0.2, JSON.stringify(strain));
  assert.ok(strain.features > 0 && strain.featuresStrainedBefore > 0 && strain.featuresStrainedAfter === 0);
  assert.ok(strain.worst.length === strain.featuresWorse, JSON.stringify(strain));
  assert.ok(minJacobian > 0 && folds === 0 && !truncated);
  const delta = await asset.fetch(0, "delta", 32, 32);
  const uv = await asset.fetch(0, "uv", 32, 32);
  const k = 16 * 32 + 16;
  assert.ok(Math.abs(uv[2 * k] - delta[2 * k] - 16.5 / 32) < 1e-6);
  const half = await asset.fetchHalf(0, "delta", 32, 32);
  assert.ok(half instanceof Uint16Array && half.length === 2 * 32 * 32 && half[2 * k] !== 0);
  assert.equal((await asset.cornerUvs()).length, 16);
  const image = { tile: 0, kind: "uv", width: 32, height: 32 };
  const fetches = [image, { ...image, kind: "delta", half: true }];
  assert.deepEqual((await asset.redirect(pose, {}, fetches)).images, [uv, half]);
  // A stroke alone, and all of it.
  const painted = values.slice().fill(255, 0, 4 * 32);
  await asset.updateRigidity(0, painted, 32, 32, [0, 0, 32, 4]);
  await asset.solve(pose);
  const stroked = await asset.fetch(0, "uv", 32, 32);
  await asset.setRigidity(0, painted, 32, 32);
  await asset.solve(pose);
  assert.deepEqual(await asset.fetch(0, "uv", 32, 32), stroked);
  // A pose that is only scaled: features keep their size, or follow it.
  for (const [scale, moves] of [["keep", true], ["follow", false]]) {
    const large = await asset.redirect(mesh.positions.map((x) => 2 * x), { scale }, [{ ...image, kind: "delta" }]);
    assert.equal(large.images[0].some((x) => Math.abs(x) > 1e-3), moves, scale);
    close([large.scale, large.scaleSpread], [2, 0], 1e-6, "scale");
  }
  // Under a mask, nothing moves.
  await asset.setMask(0, new Uint8Array(1), 1, 1);
  await asset.solve(pose);
  assert.ok((await asset.fetch(0, "delta", 8, 8)).every((x) => x === 0));
});

both("derivatives are those of the map, and another UV set is looked up where the map leads", async (create) => {
  const { mesh, values, pose } = squares();
  const second = { uvs: mesh.uvs.map((x) => 0.25 + x / 2), uvIndices: mesh.uvIndices };
  const asset = await create({ ...mesh, uvSets: [second] });
  assert.deepEqual(asset.tiles.map(({ uvSet }) => uvSet), [0, 1]);
  await asset.setRigidity(0, values, 32, 32);
  await asset.solve(pose);
  const size = 256;
  const of = (kind, uvSet) => asset.fetch(0, kind, size, size, uvSet);
  const [uv, jacobian, scale] = [await of("uv"), await of("jacobian"), await of("filterScale")];
  assert.deepEqual([jacobian.length, scale.length], [4 * size * size, size * size]);
  close(await of("uvSet", 1), uv.map((x) => 0.25 + x / 2), 1e-6, "UV in set 1");
  close(await of("uvSetDelta", 1), (await of("delta")).map((x) => x / 2), 1e-6, "its difference");
  let steepest = 0;
  for (const k of [60, 128, 190].flatMap((row) => [40, 101, 128, 200].map((column) => row * size + column))) {
    const [a, b, c, d] = jacobian.subarray(4 * k, 4 * k + 4);
    // The first row is v = 1.
    const along = (step, axis) => ((uv[2 * (k + step) + axis] - uv[2 * (k - step) + axis]) * size) / 2;
    close([a, b, c, d], [along(1, 0), along(-size, 0), along(1, 1), along(-size, 1)], 0.02, `derivatives at ${k}`);
    const [sum, det] = [(a * a + b * b + c * c + d * d) / 2, a * d - b * c];
    close([scale[k]], [Math.sqrt(sum + Math.sqrt(Math.max(0, sum * sum - det * det)))], 1e-5, "largest singular value");
    steepest = Math.max(steepest, Math.abs(a - 1));
  }
  assert.ok(steepest > 0.05, "the map bends");
  // Nothing is rigid in set 1.
  const own = [...mesh.uvIndices].flatMap((k) => [...second.uvs.subarray(2 * k, 2 * k + 2)]);
  close(await asset.cornerUvs(1), own, 1e-6, "corners in set 1");
});

both("carried points are on the surface where their texture is", async (create) => {
  const { mesh, values, pose } = squares();
  const asset = await create(mesh);
  await asset.setRigidity(0, values, 32, 32);
  const uvs = new Float32Array([0.2, 0.3, 0.45, 0.5, 0.7, 0.9, 0.9, 0.1, 2.5, 0.5]);
  const heights = new Float64Array([0, 0.1, 0.2, 0.3, 0]);
  const studs = await asset.carrier({ uvs, heights, fit: "surface" });
  const weights = new Float32Array([1, 1, 2, 0, 0, 1]);
  const corners = await asset.carrier({ corners: new Uint32Array([0, 1, 2, 4, 5, 6]), weights, fit: "none" });
  const near = await asset.carrier({ positions: new Float32Array([0.5, 0.5, 0.05, 0.5, 0.5, 3]), farthest: 0.1 });
  const frames = new Float32Array([0, 0, 1, 0]);
  const turned = await asset.carrier({ positions: new Float32Array([1.8, 0.2, 0]), frames });
  assert.deepEqual([...(await studs.info()).states], [0, 0, 0, 0, 1]);
  const { points, outside, tooFar, states } = await near.info();
  assert.deepEqual([points, outside, tooFar, ...states], [2, 0, 1, 0, 3]);
  await rejects(() => studs.fetch(), { code: "NotSolved" });

  // A quarter turn about z: x, y of the stretched squares become -y, x.
  const quarter = pose.map((_, k) => [-pose[k + 1], pose[k - 1], 0][k % 3]);
  const map = { tile: 0, kind: "uv", width: 256, height: 256 };
  const wanted = ["positions", "matrices", "stretch", "uvs"];
  const fetches = [{ carrier: studs, outputs: wanted }, map, { carrier: corners }];
  const { images, carried } = await asset.redirect(quarter, {}, fetches);
  const [of, ofCorners] = carried;
  assert.deepEqual(Object.keys(of), wanted);
  assert.deepEqual(await studs.fetch(...wanted), of);
  for (let k = 0; k < 4; k++) {
    const [u, v] = of.uvs.subarray(2 * k, 2 * k + 2);
    // Linear in the left square, which is stretched by 1.3, and in the right one, squashed to 0.7.
    const x = u < 0.5 ? 2.6 * u : 1.3 + 1.4 * (u - 0.5);
    close(of.positions.slice(3 * k, 3 * k + 3), [-v, x, heights[k]], 1e-5, `position ${k}`);
    const texel = Math.floor((1 - v) * 256) * 256 + Math.floor(u * 256);
    close(images[0].slice(2 * texel, 2 * texel + 2), uvs.slice(2 * k, 2 * k + 2), 1 / 256, `its texture, ${k}`);
  }
  close(of.matrices.slice(0, 9), [0, -1, 0, 1, 0, 0, 0, 0, 1], 0.2, "matrix of the first point");
  assert.ok(of.stretch.length === 10 && of.stretch[2] < 1.1, "the feature is not stretched");
  // The mean of corners at (0, 0), (1, 0) and twice (1, 1); the third of the second face's three corners.
  close(ofCorners.positions, [-0.5, 0.975, 0, -1, 2, 0], 1e-6, "corners");
  close(ofCorners.rotations, [0, 0, Math.SQRT1_2, Math.SQRT1_2, 0, 0, Math.SQRT1_2, Math.SQRT1_2], 1e-6, "rotations");
  // Half a turn about z at rest, and a quarter more.
  close((await turned.fetch()).rotations.map(Math.abs), [0, 0, Math.SQRT1_2, Math.SQRT1_2], 1e-3, "its own frame");

  const other = await create(mesh);
  const foreign = await other.carrier({ uvs });
  await rejects(() => asset.redirect(pose, {}, [{ carrier: foreign }]), { message: /no carrier of this asset/ });
  await rejects(() => studs.fetch("rotations", "matrices"), { message: /^outputs: rotations and matrices are both/ });
  await rejects(() => studs.fetch("position"), { message: /^outputs: 'position' is not one of positions, / });
  await studs.free();
  await studs.free();
  await rejects(() => studs.fetch(), { code: "InvalidArgument", message: /^carrier: it was freed/ });
  await rejects(() => studs.info(), { message: /^carrier: it was freed/ });
});

both("errors name the argument, and nothing is lost", async (create) => {
  const { mesh, values, pose } = squares();
  const asset = await create(mesh);
  await asset.setRigidity(0, values, 32, 32);
  await rejects(() => asset.fetch(0, "uv", 8, 8), { code: "NotSolved" });
  await asset.solve(pose);
  const uvs = await asset.fetch(0, "uv", 32, 32);
  const sent = new Float32Array(18);
  structuredClone(sent, { transfer: [sent.buffer] });
  const image = { tile: 0, kind: "uv", width: 8, height: 8 };
  const wrong = [
    [() => create({}), "mesh.positions: it is missing"],
    [() => create({ ...mesh, positons: 1 }), "mesh.positons: there is no such field"],
    [() => create({ ...mesh, indices: [0, 1, 2] }), "mesh.indices: a typed array is expected"],
    [() => create({ ...mesh, indices: new Uint16Array(8) }), "mesh.indices: a Uint32Array is expected"],
    [() => create({ ...mesh, uvs: new Float32Array(11) }), "mesh.uvs: 11 numbers are no multiple of 2"],
    [() => create({ ...mesh, uvSets: [{}] }), "mesh.uvSets[0].uvs: it is missing"],
    [() => asset.setRigidity(0, values, 32, 31), "values: 1024 values for 32 x 31 texels"],
    [() => asset.setRigidity(7, values, 32, 32), /tile: index 7/],
    [() => asset.setRigidity("one", values, 32, 32), "tile: NaN is not a whole number of at least 0"],
    [() => asset.setRigidity(0, new Float32Array([Number.NaN]), 1, 1), /is NaN/],
    [() => asset.solve(pose, { quality: "best" }), "options.quality: 'best' is not one of draft, normal"],
    [() => asset.solve(pose, { timeBudget: -1 }), "options.timeBudget: -1 is no time in milliseconds"],
    [() => asset.solve(pose, { warm: 1 }), "options.warm: true or false is expected"],
    [() => asset.redirect(pose, { replace: "no" }), "options.replace: true or false is expected"],
    [() => asset.solve(pose.slice(3)), "positions: 5 elements, but the mesh has 6 vertices"],
    [() => asset.solve(new Int32Array(18)), "positions: a typed array is expected"],
    [() => asset.setSettings(0, { smoothness: -1 }), /settings.smoothness: -1 is not between/],
    [() => asset.setSettings(0, { room_threshold: 1 }), "settings.room_threshold: there is no such field"],
    [() => asset.setSettings(0, { grid: -5 }), "settings.grid: -5 is not a whole number of at least 0"],
    [() => asset.fetch(0, "UV", 8, 8), /^kind: 'UV' is not one of uv, delta, /],
    [() => asset.fetch(0, "uv", 0, 8), /image/],
    [() => asset.fetch(0, "uv", 8, 8, 1), /^uvSet: it goes with/],
    [() => asset.cornerUvs(1), "uv_set: 1 is out of range, there are 1"],
    [() => asset.redirect(pose, {}, null), "fetches: an array is expected"],
    [() => asset.redirect(mesh.positions, {}, [image, { ...image, kind: "lut" }]), /^fetches\[1\].kind: 'lut'/],
    [() => asset.updateRigidity(0, values, 32, 32, [30, 0, 4, 4]), /rigidity/],
    [() => asset.updateRigidity(0, values, 32, 32), "part: an array is expected"],
    [() => asset.carrier({}), "carrier: one of uvs, corners and positions says where the points are"],
    [() => asset.carrier({ uvs: pose, weights: pose }), "carrier.weights: there is no such field"],
    [() => asset.carrier({ corners: new Uint32Array(4), weights: pose }), /^carrier.corners: there are three/],
  ];
  for (const [call, message] of wrong) {
    await rejects(call, { name: "VrtmError", code: "InvalidArgument", message });
  }
  // A worker's page cannot send it.
  const detached = /^positions: 0 elements|^redirect: .*detached/;
  await rejects(() => asset.solve(sent), { name: "VrtmError", code: "InvalidArgument", message: detached });
  await rejects(() => asset.fetch(0, "uv", 30000, 30000), { code: "OutOfMemory", message: /7200000000 bytes/ });
  assert.deepEqual(await asset.fetch(0, "uv", 32, 32), uvs);
});

both("warnings reach the console or the log function, and a freed asset says so", async (create) => {
  const { mesh, pose, values } = squares();
  const [warned, failed, lines] = [[], [], []];
  const { warn, error } = console;
  Object.assign(console, { warn: (line) => warned.push(line), error: (...line) => failed.push(line[1].message) });
  let asset;
  try {
    await (await create(mesh)).solve(pose);
    const log = (entry) => {
      lines.push(entry);
      assert.ok(entry.level === "info", "not one of these");
    };
    asset = await create(mesh, { log });
    await asset.solve(pose);
  } finally {
    Object.assign(console, { warn, error });
  }
  const told = lines.find(({ code }) => code === "NoRigidity");
  assert.deepEqual([told.level, told.udim, told.values], ["warning", null, []]);
  assert.ok(lines.some(({ level, code, values }) => level === "info" && code === "Mesh" && values[0] === 6));
  assert.deepEqual(warned, [`vrtm: ${told.message}`]);
  assert.deepEqual(failed, ["not one of these"]);

  const carrier = await asset.carrier({ uvs: new Float32Array(2) });
  await asset.free();
  await asset.free();
  const methods = (type) => Object.getOwnPropertyNames(type.prototype).filter((name) => name !== "constructor");
  assert.deepEqual([methods(AssetMethods).length, methods(Carrier).length], [12, 3]);
  const calls = methods(AssetMethods).map((name) => () => asset[name]());
  for (const call of [...calls, ...methods(Carrier).map((name) => () => carrier[name]())]) {
    await rejects(call, (error) => error instanceof VrtmError && error.code === "Freed");
  }
});

test("of the poses that wait for a worker the last one alone is solved, unless it is not to be replaced", async () => {
  const asked = [];
  const worker = { postMessage: (question) => asked.push(question), terminate() {} };
  const answer = async (value) => {
    worker.onmessage({ data: { id: asked[done++].id, ...value } });
    await new Promise(setImmediate);
  };
  let done = 0;
  const created = WorkerAsset.create(squares().mesh, { worker });
  await answer({ value: [[{ udim: 1001 }]] });
  const asset = await created;
  assert.equal(asset.tiles[0].udim, 1001);
  await assert.rejects(WorkerAsset.create(squares().mesh, { worker }), { message: "worker: it has an asset already" });

  const redirect = (x, options) => asset.redirect(new Float32Array([x]), options);
  const poses = () => asked.slice(1).map(({ given }) => given[0][0]);
  const [first, second, third] = [redirect(1), redirect(2), redirect(3)];
  assert.deepEqual(poses(), [1]);
  assert.equal(await second, null);
  await answer({ value: { images: [], reports: [1] } });
  assert.deepEqual((await first).reports, [1]);
  assert.deepEqual(poses(), [1, 3]);
  // Calls that nothing replaces: they wait for their turn in the worker, after what waited here.
  const [fourth, fifth, sixth] = [redirect(4), redirect(5, { replace: false }), asset.solve(new Float32Array([6]))];
  assert.deepEqual(poses(), [1, 3, 4, 5, 6]);
  const [seventh, eighth] = [redirect(7), redirect(8)];
  assert.equal(await seventh, null);
  const failed = assert.rejects(third, { code: "InvalidArgument", message: "positions: no" });
  await answer({ error: { code: "InvalidArgument", message: "positions: no" } });
  await failed;
  for (const x of [4, 5, 6]) {
    assert.equal(poses().length, 5, "8 waits for all of them");
    await answer({ value: x });
  }
  assert.deepEqual([await fourth, await fifth, await sixth], [4, 5, undefined]);
  assert.deepEqual(poses(), [1, 3, 4, 5, 6, 8]);
  await answer({ value: 8 });
  assert.equal(await eighth, 8);
});

test("calls of a worker that has died fail, those under way and all later ones", async () => {
  const { mesh, pose, values } = squares();
  const deaths = [
    ["WorkerEnded", "the worker has ended: out of memory", (worker) => worker.onerror({ message: "out of memory" })],
    ["WorkerEnded", "the worker has ended: its answer cannot be read", (worker) => worker.onmessageerror({})],
    ["WorkerEnded", "the worker was terminated", (worker) => worker.terminate()],
    ["Freed", "the asset was freed", (_, asset) => asset.free()],
  ];
  for (const [code, message, die] of deaths) {
    const worker = new Thread();
    const asset = await WorkerAsset.create(mesh, { worker });
    const carrier = await asset.carrier({ uvs: new Float32Array(2) });
    const ends = [asset.setRigidity(0, values, 32, 32), asset.redirect(pose), asset.redirect(pose), asset.cornerUvs()];
    die(worker, asset);
    ends.push(asset.redirect(pose), asset.solve(pose), asset.report(0), carrier.fetch(), asset.redirect(pose));
    // The next to the last one was replaced.
    assert.equal(await ends.splice(4, 1)[0].catch(({ code }) => code), code);
    for (const end of ends) {
      await assert.rejects(end, { name: "VrtmError", code, message });
    }
    await asset.free();
    await assert.rejects(asset.report(0), { code, message }, "the first reason stays");
  }
  const nowhere = new Thread(new URL("nowhere.js", import.meta.url));
  await assert.rejects(WorkerAsset.create(mesh, { worker: nowhere }), { code: "WorkerEnded", message: /nowhere/ });
  const wasm = "https://localhost:1/none.wasm";
  await assert.rejects(WorkerAsset.create(mesh, { worker: new Thread(), wasm }), { code: "NotLoaded" });
});

// The last one of this file, which uses up the module of its thread.
test("a module that has trapped says so in all later calls, and a log function cannot call its asset", () => {
  const { mesh, pose } = squares();
  const inside = [];
  const asset = new Asset(mesh, {
    log({ code }) {
      if (code === "NoRigidity") {
        assert.throws(() => asset.report(0), ({ code }) => inside.push(code) > 0);
        assert.throws(() => asset.free(), ({ code }) => inside.push(code) > 0);
      }
    },
  });
  asset.solve(pose);
  assert.deepEqual(inside, ["Busy", "Busy"]);
  // Leaves the call as a trap does, and nothing of it is unwound.
  const trap = new Proxy({}, { ownKeys: () => assert.fail("unreachable") });
  const calls = [() => asset.setSettings(0, trap), () => asset.report(0), () => new Asset(mesh), () => asset.free()];
  for (const call of calls) {
    assert.throws(call, { code: "Internal", message: /^the WebAssembly has ended, .* \(unreachable\)/ });
  }
});
