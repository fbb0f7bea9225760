// Two strips in motion, with the page's downloads, for take.test.mjs.
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { loadBasis, redirectByBasis } from "vrtm/three";
import { mount } from "../../../examples/web/src/take.ts";
import "./three_strip.js";

const DURATION = 0.25;
const times = Array.from({ length: 7 }, (_, k) => (k * DURATION) / 6);
const moves = times.map((t) => Math.sin((t / DURATION) * 1.5));
const root = new THREE.Group();
const made = [true, false].map((skinned, p) => {
  const material = new THREE.MeshStandardMaterial({ map: paint(!skinned) });
  const { mesh } = strip({ material, skinned, flipY: !skinned, shear: 0.3, count: 12 });
  root.add(Object.assign(mesh, { name: skinned ? "Arm" : "1 Sheet" }));
  mesh.position.y = 0.58 * p - 0.28;
  mesh.rotation.z = 0.1 * p;
  mesh.scale.setScalar(0.5);
  return mesh;
});
made[0].skeleton.bones[1].name = "Hand";
root.updateMatrixWorld();
const mixer = new THREE.AnimationMixer(root);
mixer.clipAction(new THREE.AnimationClip("motion", DURATION, [
  new THREE.VectorKeyframeTrack("Hand.position", times, moves.flatMap((x) => [0.48 * x, 0, 0.2 * x * x])),
  new THREE.NumberKeyframeTrack(`${made[1].uuid}.morphTargetInfluences`, times, moves),
])).play();
const texels = Uint8Array.from(rigidity, (share) => 255 * share);
const parts = await Promise.all(made.map(async (mesh) => {
  const wasm = new URL("vrtm_bg.wasm", location.href).href;
  const worker = new Worker("worker.js", { type: "module" });
  const redirected = await redirect(mesh, { rigidity: texels, size: SIZE, grid: 96, mapSize: 256, worker, wasm });
  return { meshes: [mesh], source: redirected.source, redirected, rigidity: texels, size: SIZE, texture: null };
}));
const open = { name: "two parts.glb", root, clip: { mixer, duration: DURATION, name: "motion" }, parts };
const seconds = (frame) => Math.min((frame - 1) / 24, DURATION - 1e-4);
mount(document.body, () => open);

/** An image of the solver, of a part in a frame. */
async function solved(part, frame, kind) {
  mixer.setTime(seconds(frame));
  const { asset, source } = parts[part].redirected;
  const fetch = { tile: 0, kind, width: 256, height: 256 };
  return Array.from((await asset.redirect(source.pose(), { replace: false }, [fetch])).images[0]);
}

/** Largest differences of a glb, as three.js plays it, from the solver: of positions, and of UVs in the middle of
 * triangles; how far these are from own ones; and the number of triangles. */
async function played(bytes) {
  const { scene, animations, parser } = await new GLTFLoader().parseAsync(Uint8Array.from(bytes).buffer, "");
  const player = new THREE.AnimationMixer(scene);
  player.clipAction(animations[0]).play();
  const off = { positions: 0, uvs: 0, own: 0, triangles: 0 };
  for (const { source, redirected, meshes: [mesh] } of parts) {
    const shown = scene.getObjectByName(mesh.name.replace(" ", "_"));
    const { index, attributes: { uv } } = shown.geometry;
    off.triangles += index.count / 3;
    const [{ targets }] = parser.json.meshes[parser.associations.get(shown).meshes].primitives;
    const moves = await Promise.all(targets.map(({ TEXCOORD_0 }) => parser.getDependency("accessor", TEXCOORD_0)));
    for (let frame = 1; frame <= 7; frame++) {
      mixer.setTime(seconds(frame));
      await redirected.update("normal");
      const pose = source.pose();
      player.setTime(seconds(frame));
      scene.updateMatrixWorld();
      source.vertexOf[0].forEach((n, v) => {
        const wanted = new THREE.Vector3().fromArray(pose, 3 * n).applyMatrix4(source.matrixWorld);
        const at = shown.getVertexPosition(v, new THREE.Vector3()).applyMatrix4(shown.matrixWorld);
        off.positions = Math.max(off.positions, at.distanceTo(wanted));
      });
      for (let k = 0; k < index.count; k += 3) {
        const mean = (of) => [0, 1, 2].reduce((sum, corner) => sum + of(index.getX(k + corner)) / 3, 0);
        const own = new THREE.Vector2(mean((v) => uv.getX(v)), mean((v) => uv.getY(v)));
        const moved = [0, 1].map((c) => mean((v) =>
          moves.reduce((sum, move, n) => sum + shown.morphTargetInfluences[n] * move.getComponent(v, c), 0)));
        const wanted = redirected.uvAt(own);
        off.uvs = Math.max(off.uvs, wanted.distanceTo(own.clone().add(new THREE.Vector2(...moved))));
        off.own = Math.max(off.own, wanted.distanceTo(own));
      }
    }
  }
  return off;
}

/** Both strips in the last frame, with the solver's maps, own UVs, and basis maps: differences of their pictures. */
async function drawn(files) {
  mixer.setTime(seconds(7));
  await Promise.all(parts.map(({ redirected }) => redirected.update("normal")));
  const drawing = () => [picture(root), renderer.domElement.toDataURL()];
  const [solver, ...urls] = drawing();
  parts.forEach(({ redirected }) => redirected.dispose());
  const own = picture(root);
  const bases = await Promise.all(files.map(loadBasis));
  const shown = made.map((mesh, p) => redirectByBasis(mesh, bases[p]));
  const rest = picture(root);
  shown.forEach(({ weights }, p) => weights.set(bases[p].weights[6]));
  const [basis, url] = drawing();
  shown.forEach((one) => one.dispose());
  const pairs = { own: [solver, own], basis: [solver, basis], rest: [own, rest], disposed: [own, picture(root)] };
  const means = Object.entries(pairs).map(([name, [a, b]]) => [name, difference(a, b).mean]);
  return { urls: [...urls, url], ...Object.fromEntries(means) };
}

Object.assign(window, { open, solved, played, drawn });
