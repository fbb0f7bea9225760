// The page in a browser: `npm run page` comes first.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { PNG } from "pngjs";
import { launch, serve, skip } from "./browser.mjs";

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

// A machine that is busy draws a picture in seconds: how quick the page is, is no matter of these tests.
const timeout = 300_000;
const solved = (page) => page.waitForSelector("#status[data-solved=normal]", { timeout });

async function opened(viewport) {
  const page = await browser.newPage();
  page.setDefaultTimeout(timeout);
  page.problems = [];
  page.on("console", (message) => ["error", "warn"].includes(message.type()) && page.problems.push(message.text()));
  page.on("pageerror", (error) => page.problems.push(error.message));
  await page.setViewport(viewport);
  await page.goto(served.url);
  await solved(page);
  return page;
}

const strain = async (page) => {
  const text = await page.$eval("#status", (status) => status.textContent);
  return text.match(/([\d.]+) → ([\d.]+)$/).slice(1).map(Number);
};

/** The canvas as it is drawn next. */
async function picture(page) {
  await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
  return PNG.sync.read(Buffer.from(await (await page.$("main")).screenshot()));
}

/** Share of the pixels that differ much between two pictures, or between the halves of one. */
function difference(a, b, shift = 0) {
  let differ = 0;
  const columns = a.width - shift;
  for (let y = 60; y < a.height; y++) {
    for (let x = 0; x < columns; x++) {
      const [p, q] = [4 * (y * a.width + x), 4 * (y * b.width + x + shift)];
      differ += [0, 1, 2].some((k) => Math.abs(a.data[p + k] - b.data[q + k]) > 40);
    }
  }
  return differ / (columns * a.height);
}

test("it solves, draws on meanwhile, moves, paints, and shows what it says", { skip, timeout }, async () => {
  const page = await opened({ width: 900, height: 620 });
  const [before, after] = await strain(page);
  assert.ok(before > 0.25 && after < 0.03, `strain ${before} -> ${after}`);
  // Both halves show the jug, and only what is painted differs.
  const bent = await picture(page);
  const halves = difference(bent, bent, bent.width / 2);
  assert.ok(halves > 0.01 && halves < 0.2, `${halves} of the pixels differ between the halves`);

  // At rest both are the same.
  const pose = (value) =>
    page.$eval("#pose", (slider, value) => {
      slider.value = value;
      slider.dispatchEvent(new Event("input"));
    }, value);
  await pose("0");
  await solved(page);
  const rest = await picture(page);
  assert.ok(difference(rest, rest, rest.width / 2) < 0.002);
  assert.ok(difference(rest, bent) > 0.03);
  await pose("1");
  await solved(page);

  // A stroke on the redirected picture makes what is under it rigid.
  await page.click("[name=look][value=rigidity] + span");
  const unpainted = await picture(page);
  await page.click("[name=tool][value=paint] + span");
  const [x, y] = [675, 400];
  await page.mouse.move(x - 50, y);
  await page.mouse.down();
  await page.mouse.move(x + 10, y, { steps: 4 });
  await page.mouse.up();
  await page.mouse.move(x + 10, 580);
  await solved(page);
  const painted = await picture(page);
  assert.ok(difference(unpainted, painted) > 0.0015, "the stroke shows");
  const [, still] = await strain(page);
  assert.ok(still < 0.06, `strain after the stroke ${still}`);
  await page.click("[name=look][value=strain] + span");
  assert.ok(difference(await picture(page), painted) > 0.05);

  const frames = await page.evaluate(async () => {
    const slider = document.getElementById("pose");
    slider.value = "0.7";
    let frames = 0;
    slider.dispatchEvent(new Event("input"));
    while (document.getElementById("status").dataset.solved !== "normal") {
      await new Promise(requestAnimationFrame);
      frames++;
    }
    return frames;
  });
  assert.ok(frames > 2, `${frames} frames`);
  assert.deepEqual(page.problems, []);
  await page.close();
});

test("it fits a phone, and has a second scene", { skip, timeout }, async () => {
  const page = await opened({ width: 390, height: 844, isMobile: true, hasTouch: true });
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(wide <= 390, `${wide} pixels wide`);
  await page.evaluate(() => delete document.getElementById("status").dataset.solved);
  await page.select("#scene", "creature");
  await solved(page);
  const [before, after] = await strain(page);
  assert.ok(before > 0.1 && after < 0.06, `strain ${before} -> ${after}`);
  // A finger turns the creature.
  const still = await picture(page);
  await page.touchscreen.touchStart(150, 300);
  await page.touchscreen.touchMove(260, 320);
  await page.touchscreen.touchEnd();
  assert.ok(difference(still, await picture(page)) > 0.02);
  assert.deepEqual(page.problems, []);
  await page.close();
});
