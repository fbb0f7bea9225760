// Public characters of the folder VRTM_GLTF, dropped on the page: `npm run page` comes first.
import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { drop, keep, launch, serve, skip } from "./browser.mjs";
import { strainOf } from "./strain.mjs";

const timeout = 600_000;
let browser, served;
before(async () => {
  if (!skip) {
    served = await serve(fileURLToPath(new URL("../../../examples/web/dist", import.meta.url)));
    browser = await launch();
  }
});
after(async () => {
  await browser?.close();
  served?.server.close();
});

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
    const page = skip || await browser.newPage();
    for (const [name, [time, colour]] of Object.entries(PUBLIC)) {
      const path = join(process.env.VRTM_GLTF ?? "", name);
      const absent = !existsSync(path) && `${name} is not in the folder VRTM_GLTF`;
      await t.test(name, { skip: absent }, async () => {
        if (page.url() === "about:blank") {
          page.setDefaultTimeout(timeout);
          await page.evaluateOnNewDocument((memory) => Object.defineProperty(navigator, "deviceMemory", { value: memory }), memory);
          await page.setViewport({ width, height, hasTouch: memory < 8, isMobile: memory < 8 });
          await page.goto(served.url);
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
  });
}
