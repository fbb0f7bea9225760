// Builds the package: `npm ci && npm run build`. Needs cargo; rustup fetches the target.
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
} catch {
  console.warn("no rustup: the target has to be there");
}
const built = process.env.CARGO_TARGET_DIR ?? `${root}target`;
const flags = `-C target-feature=+simd128 --remap-path-prefix ${root}=. --remap-path-prefix ${process.env.HOME}=~`;
// Not stripped: the packer reads what the compiler has written beside the code.
const env = { RUSTFLAGS: flags, CARGO_PROFILE_DIST_STRIP: "debuginfo" };
run("cargo", ["build", "--profile", "dist", "--package", "vrtm-web", "--target", target], env);
// The compiler wants the module's types beside the sources that import it.
run("cargo", ["run", "--quiet", "--package", "vrtm-web-pack", "--", `${built}/${target}/dist/vrtm_web.wasm`, `${here}src/wasm`]);
rmSync(`${here}dist`, { recursive: true, force: true });
run(process.execPath, [`${here}node_modules/typescript/bin/tsc`, "--project", here]);
for (const file of ["LICENSE-MIT", "LICENSE-APACHE", "bindings/THIRD-PARTY.txt"]) {
  cpSync(root + file, `${here}dist/${file.split("/").at(-1)}`);
}
mkdirSync(`${here}dist/wasm`, { recursive: true });
cpSync(`${here}src/wasm`, `${here}dist/wasm`, { recursive: true });
