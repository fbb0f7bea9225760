// The files of a release, used away from the sources: `npm run build` comes first.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { createHash } from "node:crypto";
import { mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { brotliCompressSync } from "node:zlib";

const root = fileURLToPath(new URL("../../..", import.meta.url));
const { version } = JSON.parse(readFileSync(join(root, "bindings/web/package.json")));
const folder = mkdtempSync(join(tmpdir(), "vrtm-release-"));
after(() => rmSync(folder, { recursive: true }));
before(() => {
  const options = { cwd: root, env: { ...process.env, VRTM_REPOSITORY: "https://example.org/vrtm" } };
  execFileSync("sh", ["bindings/release.sh", "--web", "--out", folder], options);
});

test("the package is installed in an empty folder, and solves", () => {
  const empty = join(folder, "empty");
  mkdirSync(empty);
  writeFileSync(join(empty, "package.json"), "{}");
  const run = (program, ...args) => execFileSync(program, args, { cwd: empty, encoding: "utf8" });
  run("npm", "install", "--offline", "--ignore-scripts", "--silent", join(folder, `vrtm-${version}.tgz`));
  const script = `
    import { Asset, load } from "vrtm";
    import { squares } from "${new URL("shared.mjs", import.meta.url)}";
    await load();
    const { mesh, values, pose } = squares();
    const asset = new Asset(mesh);
    asset.setRigidity(0, values, 32, 32);
    asset.solve(pose, { measure: true });
    console.log(asset.report(0).strain.after.rms < 0.02);`;
  assert.equal(run(process.execPath, "--input-type=module", "--eval", script), "true\n");

  const installed = join(empty, "node_modules/vrtm");
  assert.match(readFileSync(join(installed, "dist/THIRD-PARTY.txt"), "utf8"), /\nglam \d/);
  assert.match(readFileSync(join(installed, "README.md"), "utf8"), /\]\(https:\/\/example.org\/vrtm\/blob\/v/);
  assert.doesNotMatch(readFileSync(join(installed, "README.md"), "utf8"), /\]\((?!https:)/);
  const { repository } = JSON.parse(readFileSync(join(installed, "package.json")));
  assert.equal(repository, "git+https://example.org/vrtm.git");
});

test("the page's archive holds the page, with the licences of what is in it", () => {
  execFileSync("python3", ["-m", "zipfile", "-e", `vrtm-page-${version}.zip`, "."], { cwd: folder });
  const dist = join(root, "examples/web/dist");
  const page = join(folder, `vrtm-page-${version}`);
  const files = readdirSync(dist, { recursive: true });
  assert.deepEqual(readdirSync(page, { recursive: true }).sort(), files.slice().sort());
  for (const file of files.filter((file) => statSync(join(dist, file)).isFile())) {
    assert.ok(readFileSync(join(dist, file)).equals(readFileSync(join(page, file))), file);
  }
  assert.match(readFileSync(join(page, "LICENSE-three"), "utf8"), /three\.js authors[^]*Permission is hereby granted/);
  assert.match(readFileSync(join(page, "THIRD-PARTY.txt"), "utf8"), /\nglam \d/);
});

test("the sums are those of the files, and no file holds a path of this machine", () => {
  const lines = readFileSync(join(folder, "SHA256SUMS"), "utf8").trim().split("\n");
  assert.deepEqual(lines.map((line) => line.slice(66)), [`vrtm-${version}.tgz`, `vrtm-page-${version}.zip`]);
  for (const line of lines) {
    const hash = createHash("sha256").update(readFileSync(join(folder, line.slice(66)))).digest("hex");
    assert.equal(line.slice(0, 64), hash, line);
  }
  for (const build of [".", "shared"]) {
    const wasm = readFileSync(join(root, "bindings/web/dist/wasm", build, "vrtm_bg.wasm"), "latin1");
    assert.ok(!wasm.includes(root) && !wasm.includes(process.env.HOME));
  }
});

test("the page without its scenes is at most 1.2 MB by Brotli", () => {
  const dist = join(root, "examples/web/dist");
  // Decoders are fetched for files that need them.
  const fetched = readdirSync(dist, { recursive: true }).filter((file) => !/^(scenes|draco)|LICENSE|THIRD/.test(file));
  const files = fetched.map((file) => join(dist, file)).filter((file) => statSync(file).isFile());
  const sizes = files.map((file) => brotliCompressSync(readFileSync(file)).length);
  const sum = sizes.reduce((a, b) => a + b);
  assert.ok(sizes.length > 4 && sum < 1.2e6, `${sum} bytes`);
});
