// Builds the package; `npm run build` makes the page, too. Needs cargo; rustup fetches the rest.
import { execFileSync } from "node:child_process";
import { cpSync, mkdirSync, rmSync } from "node:fs";
import { fileURLToPath } from "node:url";

const here = fileURLToPath(new URL(".", import.meta.url));
const root = fileURLToPath(new URL("../..", import.meta.url));
const target = "wasm32-unknown-unknown";
const run = (program, args, env = {}) =>
  execFileSync(program, args, { cwd: root, stdio: "inherit", env: { ...process.env, ...env } });

try {
  run("rustup", ["target", "add", target]);
  run("rustup", ["component", "add", "rust-src"]);
} catch {
  console.warn("no rustup: the target and the standard library's sources have to be there");
}
const built = process.env.CARGO_TARGET_DIR ?? `${root}target`;
const paths = `--remap-path-prefix ${root}=. --remap-path-prefix ${process.env.HOME}=~`;

/** The WebAssembly as a module, with its types beside the sources that import it. */
function module(folder, features, linked, args, env) {
  const flags = [`target-feature=+simd128${features}`, ...linked.map((arg) => `link-arg=--${arg}`)];
  const RUSTFLAGS = `${paths} ${flags.map((flag) => `-C ${flag}`).join(" ")}`;
  const program = ["build", "--profile", "dist", "--package", "vrtm-web", "--target", target, ...args];
  // Not stripped: the packer reads what the compiler has written beside the code.
  run("cargo", program, { RUSTFLAGS, CARGO_PROFILE_DIST_STRIP: "debuginfo", ...env });
  const wasm = `${built}/${target}/dist/vrtm_web.wasm`;
  run("cargo", ["run", "--quiet", "--package", "vrtm-web-pack", "--", wasm, `${here}src/wasm${folder}`]);
}
module("", "", [], [], {});
// Memory that workers share takes a standard library of its own, which compilers do not build but for this variable.
const exported = ["__wasm_init_tls", "__tls_size", "__tls_align", "__tls_base", "__heap_base"];
const linked = ["shared-memory", "import-memory", "max-memory=1073741824", ...exported.map((name) => `export=${name}`)];
module("/shared", ",+atomics,+bulk-memory", linked, ["-Z", "build-std=std,panic_abort"], { RUSTC_BOOTSTRAP: "1" });

rmSync(`${here}dist`, { recursive: true, force: true });
run(process.execPath, [`${here}node_modules/typescript/bin/tsc`, "--project", here]);
for (const file of ["LICENSE-MIT", "LICENSE-APACHE", "bindings/THIRD-PARTY.txt"]) {
  cpSync(root + file, `${here}dist/${file.split("/").at(-1)}`);
}
mkdirSync(`${here}dist/wasm`, { recursive: true });
cpSync(`${here}src/wasm`, `${here}dist/wasm`, { recursive: true });
