// Strips that stretch, drawn by three.js in a page, for three.test.mjs.
import * as THREE from "three";
import { patch, redirect } from "vrtm/three";

const SIZE = 512;
/** Centres of studs, from the middle of the strip, a square with a side of 1. */
const STUDS = [-0.2, 0, 0.2].flatMap((x) => [-0.25, 0, 0.25].map((y) => [x, y]));
const MIPMAPS = { magFilter: THREE.LinearFilter, minFilter: THREE.LinearMipmapLinearFilter, needsUpdate: true };

THREE.ColorManagement.enabled = false;
const renderer = new THREE.WebGLRenderer({ antialias: true });
renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
renderer.setSize(800, 560);
const camera = new THREE.OrthographicCamera(-0.6, 1.1, 0.595, -0.595, 0.1, 10);
camera.position.z = 5;
const sun = new THREE.DirectionalLight(0xffffff, 2);
sun.position.set(0.7, 0.4, 1);
const stage = new THREE.Scene().add(sun, new THREE.AmbientLight(0xffffff, 1));

/** Height of studs with a radius of .06, 0 to 1, per texel; the first row is the upper one. */
function studs(edge) {
  return Float32Array.from({ length: SIZE * SIZE }, (_, k) => {
    const [x, y] = [((k % SIZE) + 0.5) / SIZE - 0.5, 0.5 - (Math.floor(k / SIZE) + 0.5) / SIZE];
    const away = Math.min(...STUDS.map(([a, b]) => Math.hypot(x - a, y - b)));
    return Math.min(1, Math.max(0, 0.5 + (0.06 - away) / edge));
  });
}
const rigidity = studs(1 / SIZE);

/** A texture of the colours, 0 to 1, of texels. */
function texture(flipY, colour) {
  const data = new Uint8Array(4 * SIZE * SIZE);
  for (let k = 0; k < SIZE * SIZE; k++) {
    data.set([...colour(k), 1].map((c) => Math.round(255 * c)), 4 * k);
  }
  const repeat = { wrapS: THREE.RepeatWrapping, wrapT: THREE.RepeatWrapping };
  return Object.assign(new THREE.DataTexture(data, SIZE, SIZE), MIPMAPS, repeat, { flipY, generateMipmaps: true });
}
const paint = (flipY) => texture(flipY, (k) => [rigidity[k], 0.2, 0.3]);

/** Normals of softer studs. */
function relief(flipY) {
  const heights = studs(0.06);
  return texture(flipY, (k) => {
    const [x, y] = [1, SIZE].map((step) => (heights[k - step] ?? 0) - (heights[k + step] ?? 0));
    return new THREE.Vector3(x, flipY ? -y : y, 0.05).normalize().toArray().map((c) => 0.5 + 0.5 * c);
  });
}

/** Shift of a point: the strip is stretched in x by 1.6, and sheared. */
function moved(x, y, shear) {
  const along = Math.min(1, Math.max(0, (x + 0.4) / 0.8));
  return 0.48 * along + shear * along * y;
}

/** A strip that bones or a morph target stretch by an amount. */
function strip({ material, skinned = false, flipY = true, shear = 0, count = 60 }) {
  const geometry = new THREE.PlaneGeometry(1, 1, count, count);
  const { position, uv } = geometry.attributes;
  // Two halves, for two materials.
  [0, 1].forEach((half) => geometry.addGroup(3 * half * count * count, 3 * count * count, half));
  uv.array.forEach((v, k) => flipY || k % 2 === 0 || (uv.array[k] = 1 - v));
  const shifts = Array.from({ length: position.count }, (_, k) => moved(position.getX(k), position.getY(k), shear));
  const numbers = (size, make) => new THREE.Float32BufferAttribute(shifts.flatMap(make), size);
  if (!skinned) {
    geometry.morphAttributes.position = [numbers(3, (x) => [x, 0, 0])];
    geometry.morphTargetsRelative = true;
    const mesh = new THREE.Mesh(geometry, material);
    return { mesh, pose: (amount) => (mesh.morphTargetInfluences[0] = amount) };
  }
  geometry.setAttribute("skinIndex", numbers(4, () => [0, 1, 0, 0]));
  geometry.setAttribute("skinWeight", numbers(4, (x) => [1 - x / 0.48, x / 0.48, 0, 0]));
  const bones = [new THREE.Bone(), new THREE.Bone()];
  const mesh = new THREE.SkinnedMesh(geometry, material).add(bones[0].add(bones[1]));
  mesh.bind(new THREE.Skeleton(bones));
  return { mesh, pose: (amount) => (bones[1].position.x = 0.48 * amount) };
}

/** A strip that was redirected in its pose. */
async function stretched(settings, quality = "draft") {
  const made = strip(settings);
  const redirected = await redirect(made.mesh, { rigidity, size: SIZE, grid: 192 });
  made.pose(1);
  await redirected.update(quality);
  return { ...made, redirected };
}

/** A fine strip without bones in that pose, with redirected UVs. */
function exact(redirected, flipY, shear) {
  const { geometry } = strip({ flipY, count: 250 }).mesh;
  geometry.morphAttributes = {};
  const { position, uv } = geometry.attributes;
  for (let k = 0; k < uv.count; k++) {
    uv.setXY(k, ...redirected.uvAt({ x: uv.getX(k), y: uv.getY(k) }));
    position.setX(k, position.getX(k) + moved(position.getX(k), position.getY(k), shear));
  }
  return geometry;
}

/** Draws objects alone; the pixels, the lowest row first. */
function picture(...objects) {
  stage.add(...objects);
  renderer.render(stage, camera);
  stage.remove(...objects);
  const data = new Uint8Array(4 * 800 * 560);
  const gl = renderer.getContext();
  gl.readPixels(0, 0, 800, 560, gl.RGBA, gl.UNSIGNED_BYTE, data);
  return data;
}

/** Ellipses with the moments of connected pixels that have much of a channel: places, ratios of axes, areas. */
function ellipses(data, channel = 0) {
  const found = [];
  const seen = new Uint8Array(data.length / 4);
  for (let start = 0; start < seen.length; start++) {
    const blob = [];
    const visit = (k) => !seen[k] && data[4 * k + channel] > 128 && ((seen[k] = 1), blob.push(k));
    visit(start);
    for (let n = 0; n < blob.length; n++) {
      [blob[n] - 1, blob[n] + 1, blob[n] - 800, blob[n] + 800].forEach(visit);
    }
    if (blob.length > 100) {
      const mean = (of) => blob.reduce((sum, k) => sum + of(k % 800, Math.floor(k / 800)), 0) / blob.length;
      const [x, y] = [mean((x) => x), mean((_, y) => y)];
      const [xx, yy, xy] = [mean((a) => (a - x) ** 2), mean((_, b) => (b - y) ** 2), mean((a, b) => (a - x) * (b - y))];
      const [middle, root] = [(xx + yy) / 2, Math.hypot((xx - yy) / 2, xy)];
      const at = new THREE.Vector2((x + 0.5) / 400 - 1, (y + 0.5) / 280 - 1);
      found.push({ at, aspect: Math.sqrt((middle + root) / (middle - root)), area: blob.length });
    }
  }
  return found;
}

/** Mean difference of two pictures' bytes, and the largest; only of some columns. */
function difference(a, b, from = 0, to = 800) {
  const apart = a.map((value, k) => ((k >> 2) % 800 >= from && (k >> 2) % 800 < to ? Math.abs(value - b[k]) : 0));
  const most = apart.reduce((x, y) => Math.max(x, y));
  return { mean: apart.reduce((sum, value) => sum + value, 0) / a.length, most };
}

Object.assign(window, {
  THREE, STUDS, SIZE, MIPMAPS, rigidity, patch, redirect, renderer, camera, sun, paint, relief, strip, stretched, exact,
  picture, ellipses, difference,
});
