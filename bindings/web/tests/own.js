// What files.test.mjs runs in the browser: the page's modules for files, and a picture of what is open.
import { Box3, DirectionalLight, HemisphereLight, PerspectiveCamera, Scene, Sphere, WebGLRenderer } from "three";
import { mount } from "../../../examples/web/src/files.ts";
import { dispose, openFiles } from "../../../examples/web/src/own.ts";

const counts = (globalThis.counts = { workers: 0, urls: 0 });
const OwnWorker = Worker;
globalThis.Worker = class extends OwnWorker {
  constructor(...given) {
    super(...given);
    counts.workers++;
    // A worker of the package replaces it with a function of its own.
    const terminate = super.terminate.bind(this);
    this.terminate = () => {
      counts.workers--;
      terminate();
    };
  }
};
const [create, revoke] = [URL.createObjectURL, URL.revokeObjectURL];
URL.createObjectURL = (file) => (counts.urls++, create(file));
URL.revokeObjectURL = (url) => (counts.urls--, revoke(url));

const renderer = new WebGLRenderer({ canvas: document.querySelector("canvas"), antialias: true, preserveDrawingBuffer: true });
renderer.setSize(innerWidth, innerHeight);
const camera = new PerspectiveCamera(30, innerWidth / innerHeight);
const scene = new Scene();
scene.add(new HemisphereLight(0xffffff, 0x8090a0, 2), new DirectionalLight(0xffffff, 2));
let open;

export async function show(files) {
  const next = await openFiles(files);
  if (open) {
    dispose(open);
  }
  open = globalThis.open = next;
  scene.add(open.root);
}

/** What is red enough is rigid; and nothing else. */
export function paint(colour, most) {
  return Promise.all(open.parts.map(({ texture, rigidity, size, redirected }) => {
    rigidity.forEach((_, k) => {
      const away = Math.hypot(...colour.map((x, channel) => x - texture.data[4 * k + channel]));
      rigidity[k] = away < most ? 255 : 0;
    });
    return redirected.setRigidity(rigidity, size);
  }));
}

/** Poses at a share of the clip, solves, draws, and returns the reports. */
export async function pose(share, quality = "normal") {
  open.clip?.mixer.setTime(share * open.clip.duration);
  open.root.updateMatrixWorld(true);
  const results = await Promise.all(open.parts.map(({ redirected }) => redirected.update(quality, { measure: quality === "normal" })));
  return results.map((result) => result.reports[0]);
}

export function draw(strength = 1) {
  open.parts.forEach(({ redirected }) => (redirected.uniforms.strength.value = strength));
  const { center, radius } = new Box3().setFromObject(open.root, true).getBoundingSphere(new Sphere());
  const away = radius / Math.sin((camera.fov * Math.PI) / 360) / Math.min(1, camera.aspect);
  Object.assign(camera, { near: away / 50, far: away * 5 });
  camera.updateProjectionMatrix();
  camera.position.set(0.35, 0.2, 1).normalize().multiplyScalar(away).add(center);
  camera.lookAt(center);
  renderer.render(scene, camera);
  return { ...renderer.info.memory, programs: renderer.info.programs.length };
}

const done = (said) => (document.body.dataset.said = said);
mount(document.body, document.querySelector("input"), (files) => show(files).then(() => done("open"), (error) => done(error.message)));
Object.assign(globalThis, { show, paint, pose, draw });
