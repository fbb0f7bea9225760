// A sheet of two charts with eight painted discs, in 48 poses: a preview in which the newest pose wins, then each pose
// exactly, with its map and a stud. README.md says what is printed.
import { WorkerAsset } from "../../bindings/web/dist/worker_asset.js";
import { Thread } from "../../bindings/web/tests/shared.mjs";

const poses = 48, cells = 20, line = cells + 1, texels = 128;
const radius = 0.15;

const distance = (a, b) => Math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2);

/** The place on the sheet at rest, of 2 x 1, that has a UV: each half is a chart. */
function atRest(u, v) {
  const chart = u < 0.5 ? 0 : 1;
  return [chart + (u - 0.04 - 0.48 * chart) / 0.44, (v - 0.28) / 0.44, 0];
}

function posed([x, y], pose) {
  const s = pose / (poses - 1);
  return [x + 0.15 * s * x * (x - 1), y - 0.2 * s * x * y * (1 - y), 0.3 * s * x * (2 - x)];
}

/** True within so many units from the centre of the nearest of the four discs of a chart. */
function inDisc(u, v, within) {
  const rest = atRest(u, v);
  const x = Math.abs(rest[0] - (u < 0.5 ? 0 : 1) - 0.5) - 0.25, y = Math.abs(rest[1] - 0.5) - 0.25;
  return x * x + y * y < within * within;
}

function positions(pose) {
  const rest = (k) => [Math.floor(k / line ** 2) + k % line / cells, Math.floor(k / line) % line / cells];
  return new Float32Array(Array.from({ length: 2 * line ** 2 }, (_, k) => posed(rest(k), pose)).flat());
}

/** The RMS strain of the discs: lengths between neighbouring texels in the pose, over those of what they show. */
function strain(map, pose) {
  const step = 1 / texels;
  let sum = 0, count = 0;
  for (let k = 0; k < texels * (texels - 1); k++) {
    const x = k % texels, y = Math.floor(k / texels);
    for (const [dx, dy] of x + 1 < texels ? [[1, 0], [0, 1]] : []) {
      const a = map.subarray(2 * k), b = map.subarray(2 * (k + dy * texels + dx));
      if (inDisc(a[0], a[1], 0.13) && inDisc(b[0], b[1], 0.13)) {
        const u = (x + 0.5) * step, v = 1 - (y + 0.5) * step;
        const now = distance(posed(atRest(u, v), pose), posed(atRest(u + dx * step, v - dy * step), pose));
        sum += (now / distance(atRest(a[0], a[1]), atRest(b[0], b[1])) - 1) ** 2;
        count++;
      }
    }
  }
  return Math.sqrt(sum / count);
}

const faceCounts = new Uint32Array(2 * cells * cells).fill(4), corners = [], uvs = [];
for (let k = 0; k < 2 * line ** 2; k++) {
  const i = k % line, j = Math.floor(k / line) % line, chart = Math.floor(k / line ** 2);
  uvs.push(0.04 + 0.48 * chart + 0.44 * i / cells, 0.28 + 0.44 * j / cells);
  if (i < cells && j < cells) {
    corners.push(k, k + 1, k + line + 1, k + line);
  }
}
const indices = new Uint32Array(corners);
const own = new Float32Array(2 * texels * texels), painted = new Uint8Array(texels * texels);
for (let k = 0; k < texels * texels; k++) {
  const u = (k % texels + 0.5) / texels, v = 1 - (Math.floor(k / texels) + 0.5) / texels;
  own.set([u, v], 2 * k);
  painted[k] = inDisc(u, v, radius) ? 255 : 0;
}

const mesh = { positions: positions(0), faceCounts, indices, uvs: new Float32Array(uvs), uvIndices: indices };
const asset = await WorkerAsset.create(mesh, { worker: new Thread(), log: ({ message }) => console.error(message) });
await asset.setRigidity(0, painted, texels, texels);
await asset.setSettings(0, { grid: 96 });

// A stud: its tip over the middle of the first disc, and two places on its rim.
const at = new Float32Array([0.15, 0.39, 0.2, 0.39, 0.15, 0.44]);
const stud = await asset.carrier({ uvs: at, heights: new Float32Array([0.1, 0, 0]) });

// As fast as the mouse moves: each pose takes the place of the one before.
let newest;
for (let pose = 0; pose < poses; pose++) {
  newest = asset.redirect(positions(pose), { quality: "draft" });
}
await newest;
console.log(`preview ${(await asset.report(0)).minJacobian.toFixed(4)}`);

const image = { tile: 0, kind: "uv", width: texels, height: texels };
for (let pose = 0; pose < poses; pose++) {
  const fetches = [image, { carrier: stud, outputs: ["positions"] }];
  const { images: [map], carried: [{ positions: points }] } = await asset.redirect(positions(pose), {}, fetches);
  if (pose % 8 === 0 || pose === poses - 1) {
    const shown = 2 * (78 * texels + 19), tip = points.subarray(0, 3);
    const strains = [strain(own, pose), strain(map, pose)];
    const groups = [strains, map.subarray(shown, shown + 2), tip, [distance(tip, points.subarray(3))]];
    const numbers = groups.map((group) => "  " + [...group].map((number) => number.toFixed(4)).join(" "));
    console.log(String(pose).padStart(2) + numbers.join(""));
  }
}
await asset.free();
