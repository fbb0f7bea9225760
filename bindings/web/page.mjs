// Builds the page of a package that is built, as examples/web/dist, a folder for any server of files.
import { execFileSync } from "node:child_process";
import { cpSync, mkdirSync, rmSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = fileURLToPath(new URL(".", import.meta.url));
const root = fileURLToPath(new URL("../..", import.meta.url));
const page = `${root}examples/web/`;
const out = `${page}dist/`;
execFileSync(process.execPath, [`${here}node_modules/typescript/bin/tsc`, "--project", page], { stdio: "inherit" });
rmSync(out, { recursive: true, force: true });
mkdirSync(out);
await build({
  entryPoints: { main: `${page}src/main.ts`, three: `${page}src/three.ts`, worker: `${here}dist/worker.js` },
  alias: { vrtm: `${here}dist/index.js`, "vrtm/three": `${here}dist/three/index.js` },
  nodePaths: [`${here}node_modules`],
  bundle: true,
  splitting: true,
  minify: true,
  format: "esm",
  target: "es2022",
  outdir: out,
  // Of three.js and of what its package names.
  legalComments: "linked",
});
for (const file of ["index.html", "three.html", "style.css"]) {
  cpSync(page + file, out + file);
}
for (const file of ["LICENSE-MIT", "LICENSE-APACHE", "THIRD-PARTY.txt"]) {
  cpSync(`${here}dist/${file}`, out + file);
}
cpSync(`${here}node_modules/three/LICENSE`, `${out}LICENSE-three`);
// Loaded only for a file that asks for it.
cpSync(`${here}node_modules/three/examples/jsm/libs/draco/gltf`, `${out}draco`, { recursive: true });
cpSync(`${here}node_modules/three/examples/jsm/libs/draco/README.md`, `${out}draco/README.md`);
cpSync(`${here}dist/wasm/vrtm_bg.wasm`, `${out}vrtm_bg.wasm`);
cpSync(`${page}scenes`, `${out}scenes`, { recursive: true });
