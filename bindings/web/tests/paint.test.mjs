// Rigidity from pictures and from a brush: in Node, and in the page at both sizes.
import assert from "node:assert/strict";
import { before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import { PNG } from "pngjs";
import { Surface, load, rigidity } from "../dist/index.js";
import { PHONE, WIDE, options, pages, seek, still } from "./browser.mjs";

const inPage = pages();
before(() => load());

/** Red and white columns, ten texels wide each, on 40 x 20 texels; brighter ones are right. */
const [width, height] = [40, 20];
const columns = (k) => Math.floor((k % width) / 10) % 2;
const bytes = (_, k) => (columns(k >> 2) || k % 4 === 0 ? 255 : 0);
const picture = { width, height, data: Uint8ClampedArray.from({ length: 4 * width * height }, bytes) };

test("maps come from colour, brightness and detail, in the size that is asked for", () => {
  const red = rigidity.ofColour(picture, [1, 0, 0], 0.1);
  const inner = (k) => k % 10 > 0 && k % 10 < 9;
  assert.ok(red.every((texel, k) => !inner(k) || texel === (columns(k) ? 0 : 255)));
  const white = rigidity.ofBrightness(picture);
  assert.ok(white.every((texel, k) => Math.abs(texel + red[k] - 255) <= 1));
  assert.equal(rigidity.ofBrightness(picture, 0.99)[15], 255);
  assert.equal(rigidity.ofColour(picture, [1, 0, 0], 0.1, [80, 10]).length, 800);
  const detail = rigidity.ofDetail(picture, undefined, 0.6);
  assert.deepEqual([detail[5], detail[9], detail[25]], [0, 153, 0]);
  // Around what is rigid nothing is held.
  assert.equal(rigidity.ofDetail(picture, red)[9], 0);
  for (const [call, message] of [
    [() => rigidity.ofColour({ ...picture, width: 41 }, [1, 0, 0]), /^picture.data: .* four bytes/],
    [() => rigidity.ofColour(picture, [1, 0]), /^colour: three numbers/],
    [() => rigidity.ofBrightness(picture, 0, [0, 4]), /^size: columns and rows/],
    [() => rigidity.ofBrightness({ ...picture, data: new Float32Array(3200) }), /^picture.data: a Uint8Array/],
    [() => rigidity.ofDetail(picture, new Uint8Array(3)), /^features: /],
  ]) {
    assert.throws(call, { code: "InvalidArgument", message });
  }
});

test("a brush paints what is seen under it", () => {
  const indices = Uint32Array.of(0, 1, 2, 0, 2, 3);
  const positions = Float32Array.of(0, 0, 0, 2, 0, 0, 2, 2, 0, 0, 2, 0);
  const mesh = { indices, uvIndices: indices, positions, uvs: Float32Array.of(0, 0, 1, 0, 1, 1, 0, 1) };
  const surface = new Surface(mesh);
  assert.equal(surface.hit([1, 1, 1], [0, 0, -1]), null, "there is no pose yet");
  const delta = new Uint16Array(2 * 64 * 64);
  surface.pose(mesh.positions, delta, [64, 64]);
  assert.equal(surface.hit([3, 1, 1], [0, 0, -1]), null);
  const hit = surface.hit([1.5, 0.5, 1], [0, 0, -1]);
  assert.deepEqual([hit.point, hit.uv], [[1.5, 0.5, 0], [0.75, 0.25]]);
  const mean = (numbers) => numbers.reduce((sum, x) => sum + x + 0.5, 0) / numbers.length;
  const middle = ({ texels }) => [mean(texels.map((k) => k & 63)), mean(texels.map((k) => k >> 6))];
  const dab = surface.dab(hit, 0.25, 0.5, [64, 64]);
  assert.ok(Math.abs(dab.texels.length - Math.PI * 64) < 8, `${dab.texels.length} texels`);
  assert.ok(middle(dab).every((at, c) => Math.abs(at - 48) < 0.1), `${middle(dab)}`);
  assert.ok(dab.cover.every((cover, k) => cover >= 0 && cover <= 1 && (k === 0 || dab.texels[k] > dab.texels[k - 1])));
  // The texture is looked up an eighth farther left.
  surface.pose(mesh.positions, delta.map((_, k) => (k % 2 ? 0 : 0xb000)), [64, 64]);
  assert.ok(Math.abs(middle(surface.dab(hit, 0.25, 0.5, [64, 64]))[0] - 40) < 0.1);
  assert.throws(() => surface.dab({ ...hit, triangle: 2 }, 1, 1, [64, 64]), { code: "InvalidArgument" });
  const beyond = { ...mesh, indices: Uint32Array.of(0, 1, 4) };
  assert.throws(() => new Surface(beyond), { code: "InvalidArgument", message: /^mesh: / });
});

test("steps of painting take bounded memory", async () => {
  const entryPoints = [fileURLToPath(new URL("../../../examples/web/src/steps.ts", import.meta.url))];
  const [{ text }] = (await build({ entryPoints, write: false, bundle: true, format: "esm" })).outputFiles;
  const { Steps } = await import(`data:text/javascript,${encodeURIComponent(text)}`);
  const [steps, size] = [new Steps(), 4096];
  const part = { rigidity: new Uint8Array(size * size), size };
  const keep = (rect) => steps.keep([{ part, rect, texels: new Uint8Array(rect[2] * rect[3]) }]);
  keep([7, 7, 2, 3]);
  keep([0, 0, size, size]);
  keep([0, 0, size, size]);
  assert.equal(steps.done.length, 1, "both together have more than 32 MB");
  steps.move("done");
  assert.deepEqual([steps.done.length, steps.undone.length], [0, 1]);
  keep([0, 0, 1, 1]);
  assert.deepEqual([steps.done.length, steps.undone.length], [1, 0]);
});

const sizes = { desk: WIDE, phone: PHONE };

/** Notes what the page tells its worker: the map as it came, as it is there after all updates, and as the page has it;
 * and the updates before the last whole solve. */
function record() {
  const { postMessage } = Worker.prototype;
  Object.assign(window, { updates: 0, redirects: 0 });
  Worker.prototype.postMessage = function (data, ...rest) {
    const { name, given } = data;
    if (name === "setMap" && !given[0]) {
      Object.assign(window, { first: given[2].slice(), mirror: given[2].slice() });
    } else if (name === "updateRigidity") {
      const [, values, size, , [x, y, columns, rows]] = given;
      for (let row = y; row < y + rows; row++) {
        window.mirror.set(values.subarray(row * size + x, row * size + x + columns), row * size + x);
      }
      window.live = values;
      window.updates++;
    }
    window.redirects += name === "redirect";
    window.rested = name === "redirect" && given[1].quality === "normal" ? window.updates : window.rested;
    return postMessage.call(this, data, ...rest);
  };
}

async function opened(viewport) {
  const page = await inPage(viewport, { first: (page) => page.evaluateOnNewDocument(record) });
  await page.$eval("#play", (button) => button.textContent === "Pause" && button.click());
  await still(page);
  await page.$eval("#paint", (panel) => (panel.closest("details").open = true));
  page.box = await (await page.$("#view")).boundingBox();
  return page;
}

const press = (page, selector) => page.$eval(selector, (element) => element.click());
const set = (page, name, value) => page.$eval(`#paint [name=${name}]`, (slider, value) => {
  slider.value = value;
  slider.dispatchEvent(new Event("input"));
}, value);

async function tool(page, name) {
  await press(page, `[name=tool][value=${name}]`);
  await page.waitForSelector("#paint[data-ready]");
}

/** Does something that changes the map, and returns the texels that differ from the map as it came, and by how much. */
async function change(page, act) {
  const before = await page.evaluate("updates");
  await act();
  await page.waitForFunction((before) => window.updates > before, {}, before);
  await page.waitForFunction(() => document.body.dataset.solved === "normal" && window.rested === window.updates
    && window.mirror.every((texel, k) => texel === window.live[k]));
  return page.evaluate(() => {
    const by = [...window.mirror].map((texel, k) => texel - window.first[k]);
    const [more, less] = [by.filter((x) => x > 0).length, by.filter((x) => x < 0).length];
    return { more, less, sum: by.reduce((sum, x) => sum + x, 0) };
  });
}

/** A pointer over the canvas, at shares of its size: a mouse or a finger. */
function pointer({ mouse, touchscreen, box }, isTouch) {
  const at = ([x, y]) => [box.x + x * box.width, box.y + y * box.height];
  const finger = {
    down: (place) => touchscreen.touchStart(...at(place)),
    move: (place) => touchscreen.touchMove(...at(place)),
    up: () => touchscreen.touchEnd(),
  };
  return isTouch ? finger : {
    down: (place) => mouse.move(...at(place)).then(() => mouse.down()),
    move: (place) => mouse.move(...at(place), { steps: 3 }),
    up: () => mouse.up(),
  };
}

for (const [name, viewport] of Object.entries(sizes)) {
  test(`strokes are solved as they are drawn, and taken back: ${name}`, options, async () => {
    const page = await opened(viewport);
    const { down, move, up } = pointer(page, viewport.hasTouch);
    await tool(page, "paint");
    const redirects = await page.evaluate("redirects");
    const painted = await change(page, async () => {
      await down([0.56, 0.5]);
      await move([0.62, 0.52]);
      await move([0.66, 0.5]);
      await page.waitForFunction((before) => window.updates > 0 && window.redirects > before, {}, redirects);
      await up();
    });
    assert.ok(painted.more > 1000 && painted.less === 0, JSON.stringify(painted));
    const none = { more: 0, less: 0, sum: 0 };
    assert.deepEqual(await change(page, () => press(page, "[name=undo]")), none);
    assert.deepEqual(await change(page, () => press(page, "[name=redo]")), painted);
    await tool(page, "erase");
    const erased = await change(page, async () => {
      await down([0.6, 0.51]);
      await move([0.64, 0.51]);
      await up();
    });
    assert.ok(erased.sum < painted.sum && erased.less > 0, JSON.stringify(erased));
    assert.deepEqual(page.problems, []);
    await page.close();
  });
}

/** The canvas, with nothing over it. */
async function shot(page) {
  await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
  return PNG.sync.read(Buffer.from(await page.screenshot({ clip: page.box })));
}

/** For each feature of the map as it came, the share of it that is rigid now; and that of what is rigid beside them. */
function shares() {
  const { first, mirror } = window;
  const size = Math.sqrt(first.length);
  const seen = new Uint8Array(first.length);
  const found = [];
  let inside = 0;
  for (let k = 0; k < first.length; k++) {
    const waiting = first[k] > 127 && !seen[k] ? [k] : [];
    let [area, rigid] = [0, 0];
    seen[k] ||= waiting.length;
    while (waiting.length > 0) {
      const at = waiting.pop();
      area++;
      rigid += mirror[at] > 127;
      for (const next of [at - 1, at + 1, at - size, at + size]) {
        if (first[next] > 127 && !seen[next]) {
          seen[next] = 1;
          waiting.push(next);
        }
      }
    }
    inside += rigid;
    found.push(...(area > 50 ? [{ area, share: rigid / area }] : []));
  }
  return { found, outside: 1 - inside / mirror.filter((texel) => texel > 127).length };
}

test("a colour that is picked on the model keeps its shape", options, async () => {
  const page = await opened(sizes.desk);
  // Where the skin is stretched most, the mesh's own UVs lead elsewhere.
  await seek(page, 3);
  // A scale: the place that is yellow all around, between the fin and the eye.
  const { width, height, data } = await shot(page);
  const yellow = (x, y) => Math.min(...[-6, 0, 6].flatMap((dx) => [-6, 0, 6].map((dy) => {
    const k = 4 * ((y + dy) * width + x + dx);
    return data[k + 1] - data[k + 2];
  })));
  let best = [Math.floor(0.6 * width), Math.floor(0.4 * height)];
  for (let y = best[1]; y < 0.65 * height; y++) {
    for (let x = Math.floor(0.56 * width); x < 0.64 * width; x++) {
      best = yellow(x, y) > yellow(...best) ? [x, y] : best;
    }
  }
  await tool(page, "pick");
  await page.mouse.click(page.box.x + best[0], page.box.y + best[1]);
  const all = (await change(page, () => press(page, "[name=clear]"))).sum;
  await change(page, () => set(page, "tolerance", 0.28));
  const { found, outside } = await page.evaluate(shares);
  // The eyes are features, too, of other colours: the two that are largest.
  const sorted = found.sort((a, b) => b.area - a.area).map(({ share }) => share);
  const [eyes, scales] = [sorted.slice(0, 2), sorted.slice(2)];
  assert.ok(scales.length > 60 && Math.min(...scales) > 0.5, `${scales.length} scales, ${Math.min(...scales)}`);
  assert.ok(outside < 0.001 && Math.max(...eyes) < 0.3, `${outside} beside features, ${eyes} of the eyes`);
  // Another tolerance takes the place of the first one, and one step takes it back.
  const few = await change(page, () => set(page, "tolerance", 0.04));
  assert.ok(few.sum < (await change(page, () => set(page, "tolerance", 0.28))).sum);
  assert.equal((await change(page, () => press(page, "[name=undo]"))).sum, all);
  for (const name of ["bright", "dark", "detail"]) {
    assert.ok((await change(page, () => press(page, `[name=${name}]`))).sum > all, name);
    assert.equal((await change(page, () => press(page, "[name=undo]"))).sum, all);
  }
  assert.deepEqual(page.problems, []);
  await page.close();
});

test("two fingers turn, and what the first one has painted is taken back", options, async () => {
  const page = await opened(sizes.phone);
  await tool(page, "paint");
  const still = await shot(page);
  const fingers = await page.createCDPSession();
  const { box } = page;
  const touch = (type, ...places) => {
    const touchPoints = places.map(([x, y], id) => ({ id, x: box.x + x * box.width, y: box.y + y * box.height }));
    return fingers.send("Input.dispatchTouchEvent", { type, touchPoints });
  };
  const left = await change(page, async () => {
    await touch("touchStart", [0.6, 0.5]);
    await page.waitForFunction("updates > 0");
    await touch("touchStart", [0.6, 0.5], [0.8, 0.6]);
    for (const x of [0.05, 0.1, 0.15, 0.2]) {
      await touch("touchMove", [0.6 - x, 0.5], [0.8 - x, 0.6]);
    }
    await touch("touchEnd");
  });
  assert.deepEqual(left, { more: 0, less: 0, sum: 0 });
  const { data } = await shot(page);
  assert.ok(still.data.filter((byte, k) => Math.abs(byte - data[k]) > 40).length > 0.01 * data.length, "it has turned");
  assert.deepEqual(page.problems, []);
  await page.close();
});
