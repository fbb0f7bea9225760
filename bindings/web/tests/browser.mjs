// A browser without a window, with WebGL in software, and a server of files. CHROMIUM is its program; where there is none,
// the tests say so.
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { createServer } from "node:http";
import { join } from "node:path";
import puppeteer from "puppeteer-core";

const TYPES = { js: "text/javascript", css: "text/css", wasm: "application/wasm", png: "image/png" };

/** A server of a folder's files, and its address; `index` is the page where the folder has none. */
export async function serve(folder, index, headers = {}) {
  const server = createServer((request, response) => {
    const { pathname } = new URL(request.url, "http://localhost");
    try {
      const bytes = index && pathname === "/" ? index : readFileSync(join(folder, pathname === "/" ? "index.html" : pathname));
      const type = TYPES[pathname.split(".").at(-1)] ?? "text/html";
      response.writeHead(200, { "content-type": type, ...headers }).end(bytes);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return { server, url: `http://127.0.0.1:${server.address().port}/` };
}

const program = [process.env.CHROMIUM, "/usr/bin/chromium", "/usr/bin/google-chrome"].find((path) => path && existsSync(path));
export const skip = program ? false : "there is no Chromium";

export function launch() {
  const args = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"];
  return puppeteer.launch({ executablePath: program, args, protocolTimeout: 600_000 });
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
