// Strips that stretch, drawn by three.js in a page, for three.test.mjs.
import * as THREE from "three";
import { patch, redirect } from "vrtm/three";

const RADIUS = 0.06;
/** Centres of studs, from the middle of the strip, a square with a side of 1. */
const STUDS = [-0.2, 0, 0.2].flatMap((x) => [-0.25, 0, 0.25].map((y) => [x, y]));

THREE.ColorManagement.enabled = false;
const renderer = new THREE.WebGLRenderer({ antialias: true });
renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
renderer.setSize(800, 560);
const camera = new THREE.OrthographicCamera(-0.6, 1.1, 0.595, -0.595, 0.1, 10);
camera.position.z = 5;
const sun = new THREE.DirectionalLight(0xffffff, 2);
sun.position.set(0.7, 0.4, 1);
const stage = new THREE.Scene().add(sun, new THREE.AmbientLight(0xffffff, 1));

/** Height of studs, 0 to 1, per texel; the first row is the upper one. */
function studs(size, edge = 1 / size) {
  return Float32Array.from({ length: size * size }, (_, k) => {
    const [x, y] = [((k % size) + 0.5) / size - 0.5, 0.5 - (Math.floor(k / size) + 0.5) / size];
    const away = Math.min(...STUDS.map(([a, b]) => Math.hypot(x - a, y - b)));
    return Math.min(1, Math.max(0, 0.5 + (RADIUS - away) / edge));
  });
}
const rigidity = studs(256);

/** A texture of colours, 0 to 1, given by column and row. */
function texture(size, flipY, colour) {
  const data = new Uint8Array(4 * size * size);
  for (let k = 0; k < size * size; k++) {
    data.set([...colour(k % size, Math.floor(k / size)).map((c) => Math.round(255 * c)), 255], 4 * k);
  }
  const made = new THREE.DataTexture(data, size, size);
  return Object.assign(made, {
    flipY, magFilter: THREE.LinearFilter, minFilter: THREE.LinearMipmapLinearFilter, generateMipmaps: true,
    wrapS: THREE.RepeatWrapping, wrapT: THREE.RepeatWrapping, needsUpdate: true,
  });
}

function paint(flipY, size = 1024) {
  const heights = studs(size);
  return texture(size, flipY, (x, y) => [heights[y * size + x], 0.2, 0.3]);
}

/** Normals of softer studs. */
function relief(flipY, size = 512) {
  const heights = studs(size, 0.06);
  const at = (x, y) => heights[Math.min(size - 1, Math.max(0, y)) * size + Math.min(size - 1, Math.max(0, x))];
  return texture(size, flipY, (x, y) => {
    const normal = new THREE.Vector3(at(x - 1, y) - at(x + 1, y), at(x, y + 1) - at(x, y - 1), 0.05).normalize();
    return [normal.x, flipY ? normal.y : -normal.y, normal.z].map((c) => 0.5 + 0.5 * c);
  });
}

/** The pose of a point: stretched in x by 1.6, and sheared by `shear`. */
const moved = (x, y, shear) => {
  const along = Math.min(1, Math.max(0, (x + 0.4) / 0.8));
  return [0.48 * along + shear * along * y, 0];
};

/** A strip that bones or a morph target stretch; `pose(1)` does. */
function strip({ material, skinned = false, flipY = true, shear = 0, count = 60 }) {
  const geometry = new THREE.PlaneGeometry(1, 1, count, count);
  const { position, uv } = geometry.attributes;
  if (!flipY) {
    uv.array.forEach((v, k) => (uv.array[k] = k % 2 ? 1 - v : v));
  }
  const points = Array.from({ length: position.count }, (_, k) => moved(position.getX(k), position.getY(k), shear));
  const attribute = (array, size) => new THREE.Float32BufferAttribute(array.flat(), size);
  if (!skinned) {
    geometry.morphAttributes.position = [attribute(points.map(([x, y]) => [x, y, 0]), 3)];
    geometry.morphTargetsRelative = true;
    const mesh = new THREE.Mesh(geometry, material);
    return { mesh, pose: (amount) => (mesh.morphTargetInfluences[0] = amount) };
  }
  geometry.setAttribute("skinIndex", attribute(points.map(() => [0, 1, 0, 0]), 4));
  geometry.setAttribute("skinWeight", attribute(points.map(([x]) => [1 - x / 0.48, x / 0.48, 0, 0]), 4));
  const bones = [new THREE.Bone(), new THREE.Bone()];
  const mesh = new THREE.SkinnedMesh(geometry, material);
  mesh.add(bones[0].add(bones[1]));
  mesh.bind(new THREE.Skeleton(bones));
  return { mesh, pose: (amount) => (bones[1].position.x = 0.48 * amount) };
}

/** The strip at rest in the shape of a pose, with the UVs that a map redirects to: own bilinear look-up. */
function exact({ mesh }, { delta, mapSize }, flipY, shear) {
  const geometry = mesh.geometry.clone();
  geometry.morphAttributes = {};
  const { position, uv } = geometry.attributes;
  for (let k = 0; k < uv.count; k++) {
    const [u, v] = [uv.getX(k), flipY ? 1 - uv.getY(k) : uv.getY(k)];
    const [x, y] = [u, v].map((t) => Math.min(mapSize - 1.001, Math.max(0, t * mapSize - 0.5)));
    const [i, j] = [Math.floor(x), Math.floor(y)];
    const at = (c) => [[0, 0], [1, 0], [0, 1], [1, 1]].reduce((sum, [a, b]) => {
      const value = THREE.DataUtils.fromHalfFloat(delta[2 * ((j + b) * mapSize + i + a) + c]);
      return sum + value * (a ? x - i : i + 1 - x) * (b ? y - j : j + 1 - y);
    }, 0);
    uv.setXY(k, u + at(0), uv.getY(k) + (flipY ? at(1) : -at(1)));
    position.setX(k, position.getX(k) + moved(position.getX(k), position.getY(k), shear)[0]);
  }
  return geometry;
}

/** Draws objects alone; the pixels, the lowest row first. */
function picture(...objects) {
  stage.add(...objects);
  renderer.render(stage, camera);
  stage.remove(...objects);
  const gl = renderer.getContext();
  const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
  const data = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, data);
  return { data, width, height };
}

/** Ratios of the axes of ellipses with the moments of connected pixels whose red is over `threshold`. */
function aspects({ data, width, height }, threshold = 128) {
  const found = [];
  const seen = new Uint8Array(width * height);
  for (let start = 0; start < seen.length; start++) {
    const blob = [];
    const visit = (k) => !seen[k] && data[4 * k] > threshold && ((seen[k] = 1), blob.push(k));
    visit(start);
    for (let n = 0; n < blob.length; n++) {
      [blob[n] - 1, blob[n] + 1, blob[n] - width, blob[n] + width].forEach(visit);
    }
    if (blob.length > 100) {
      const [x, y] = [blob.map((k) => k % width), blob.map((k) => Math.floor(k / width))];
      const mean = (values) => values.reduce((a, b) => a + b) / values.length;
      const [mx, my] = [mean(x), mean(y)];
      const at = new THREE.Vector2(mx + 0.5, my + 0.5).multiply({ x: 2 / width, y: 2 / height }).subScalar(1);
      const [xx, yy, xy] = [
        mean(x.map((v) => (v - mx) ** 2)), mean(y.map((v) => (v - my) ** 2)), mean(x.map((v, k) => (v - mx) * (y[k] - my))),
      ];
      const root = Math.hypot((xx - yy) / 2, xy);
      found.push({ at, aspect: Math.sqrt(((xx + yy) / 2 + root) / ((xx + yy) / 2 - root)), area: blob.length });
    }
  }
  return found;
}

/** Mean difference of two pictures' bytes, and the largest. */
function difference(a, b) {
  let [sum, most] = [0, 0];
  a.data.forEach((value, k) => {
    const apart = Math.abs(value - b.data[k]);
    sum += apart;
    most = Math.max(most, apart);
  });
  return { mean: sum / a.data.length, most };
}

/** A strip that was redirected in its pose, by default with a draft. */
async function stretched(settings, options = {}, quality = "draft") {
  const made = strip(settings);
  const redirected = await redirect(made.mesh, { rigidity, size: 256, mapSize: 512, ...options });
  made.pose(1);
  await redirected.update(quality);
  return { ...made, redirected };
}

Object.assign(window, {
  THREE, STUDS, patch, redirect, renderer, camera, stage, sun, texture, paint, relief, strip, stretched, exact, picture, aspects, difference,
});
