// A browser without a window, with WebGL in software, and a server of files. CHROMIUM is its program; where there is
// none, the tests say so.
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { createServer } from "node:http";
import { join } from "node:path";
import { after, before } from "node:test";
import { fileURLToPath } from "node:url";
import puppeteer from "puppeteer-core";

const TYPES = { js: "text/javascript", css: "text/css", wasm: "application/wasm", png: "image/png" };

/** A server of a folder's files, and its address; `index` is the page where the folder has none. */
export async function serve(folder, index, headers = {}) {
  const server = createServer((request, response) => {
    const { pathname } = new URL(request.url, "http://localhost");
    try {
      const isIndex = pathname === "/";
      const bytes = (isIndex && index) || readFileSync(join(folder, isIndex ? "index.html" : pathname));
      const type = TYPES[pathname.split(".").at(-1)] ?? "text/html";
      response.writeHead(200, { "content-type": type, ...headers }).end(bytes);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return { server, url: `http://127.0.0.1:${server.address().port}/` };
}

const programs = [process.env.CHROMIUM, "/usr/bin/chromium", "/usr/bin/google-chrome"];
const program = programs.find((path) => path && existsSync(path));
export const skip = program ? false : "there is no Chromium";

export function launch() {
  const args = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"];
  return puppeteer.launch({ executablePath: program, args, protocolTimeout: 600_000 });
}

/** A machine that is busy draws a picture in seconds: how quick the page is, is no matter of tests. */
export const options = { skip, timeout: 600_000 };
export const WIDE = { width: 1280, height: 800 };
export const PHONE = { width: 390, height: 844, isMobile: true, hasTouch: true };

/** Serves the page to the tests of a file, and does something first; the function that opens it. `npm run build` comes
 * before. */
export function pages(first = () => {}) {
  let browser, served;
  before(async () => {
    if (!skip) {
      served = await serve(fileURLToPath(new URL("../../../examples/web/dist", import.meta.url)));
      browser = await launch();
      await first();
    }
  });
  after(async () => {
    await browser?.close();
    served?.server.close();
  });
  return async (viewport, { hash = "", first = () => {}, ready = "body[data-solved]" } = {}) => {
    const page = Object.assign(await browser.newPage(), { problems: [] });
    page.setDefaultTimeout(options.timeout);
    page.on("console", (message) => ["error", "warn"].includes(message.type()) && page.problems.push(message.text()));
    page.on("pageerror", (error) => page.problems.push(error.message));
    await page.setViewport(viewport);
    await first(page);
    await page.goto(served.url + hash);
    await page.waitForSelector(ready);
    return page;
  };
}

export const still = (page) => page.waitForSelector("body[data-state=still][data-solved=normal]");

/** Goes to a time of the clip. */
export async function seek(page, time) {
  await page.$eval("#time", (slider, time) => {
    slider.value = time;
    slider.dispatchEvent(new Event("input"));
  }, time);
  await still(page);
}

/** Drops a file or folder of this machine on the page. */
export async function drop(page, path) {
  const session = await page.createCDPSession();
  const data = { items: [], files: [path], dragOperationsMask: 1 };
  for (const type of ["dragEnter", "dragOver", "drop"]) {
    await session.send("Input.dispatchDragEvent", { type, x: 200, y: 300, data });
  }
}

/** Keeps a picture in the folder VRTM_SHOTS, to be looked at. */
export async function keep(page, name) {
  const folder = process.env.VRTM_SHOTS;
  if (folder) {
    writeFileSync(join(folder, `${name.replaceAll(" ", "_")}.png`), await page.screenshot());
  }
}
