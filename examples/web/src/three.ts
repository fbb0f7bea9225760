/** vrtm/three in a page of its own: studs painted on a tube that its bones stretch and bend. */
import {
  Bone, CanvasTexture, CylinderGeometry, DirectionalLight, DoubleSide, Float32BufferAttribute, Group,
  MeshStandardMaterial, NeutralToneMapping, PMREMGenerator, PerspectiveCamera, Scene, Skeleton, SkinnedMesh,
  SRGBColorSpace, WebGLRenderer,
} from "three";
import { RoomEnvironment } from "three/addons/environments/RoomEnvironment.js";
import { redirect } from "vrtm/three";

const SIZE = 1024;
const [RADIUS, LENGTH, STUD, BONES] = [0.7, 4, 0.22, 6];

/** A picture of the tube's side, all around: studs on a ground. */
function draw(ground: string, stud: string): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = SIZE;
  const context = canvas.getContext("2d", { willReadFrequently: true })!;
  context.fillStyle = ground;
  context.fillRect(0, 0, SIZE, SIZE);
  context.fillStyle = stud;
  for (let k = 0; k < 30; k++) {
    const row = Math.floor(k / 5);
    const [x, y] = [((k % 5) + (row % 2 ? 0.7 : 0.3)) / 5, (row + 0.5) / 6];
    context.beginPath();
    const [across, along] = [(STUD * SIZE) / (2 * Math.PI * RADIUS), (STUD * SIZE) / LENGTH];
    context.ellipse(x * SIZE, y * SIZE, across, along, 0, 0, 2 * Math.PI);
    context.fill();
  }
  return canvas;
}
const map = new CanvasTexture(draw("#16324a", "#e0a53c"));
map.colorSpace = SRGBColorSpace;
// Studs are raised, of metal, and rigid.
const studs = draw("#000", "#fff");
const relief = new CanvasTexture(studs);
map.anisotropy = relief.anisotropy = 8;

/** A tube with a bone at each joint; a vertex is moved by the two that are next to it. */
function tube(): SkinnedMesh {
  const geometry = new CylinderGeometry(RADIUS, RADIUS, LENGTH, 64, 96, true, Math.PI).translate(0, LENGTH / 2, 0);
  const { position } = geometry.attributes;
  const [indices, weights]: number[][] = [[], []];
  for (let k = 0; k < position.count; k++) {
    const at = (position.getY(k) / LENGTH) * (BONES - 1);
    const bone = Math.min(BONES - 2, Math.floor(at));
    indices.push(bone, bone + 1, 0, 0);
    weights.push(1 - (at - bone), at - bone, 0, 0);
  }
  geometry.setAttribute("skinIndex", new Float32BufferAttribute(indices, 4));
  geometry.setAttribute("skinWeight", new Float32BufferAttribute(weights, 4));
  const mesh = new SkinnedMesh(geometry, new MeshStandardMaterial({
    map, bumpMap: relief, bumpScale: 4, metalnessMap: relief, metalness: 1, roughness: 0.35, side: DoubleSide,
  }));
  const bones = Array.from({ length: BONES }, () => new Bone());
  bones.forEach((bone, k) => (bones[k - 1] ?? mesh).add(bone));
  pose(mesh, bones, 0);
  mesh.updateMatrixWorld(true);
  mesh.bind(new Skeleton(bones));
  return mesh;
}

function pose(mesh: SkinnedMesh, bones: Bone[], amount: number): void {
  mesh.position.y = 0;
  bones.slice(1).forEach((bone, k) => {
    bone.position.y = (LENGTH / (BONES - 1)) * (1 + amount * 0.45 * (1 + Math.sin(2.4 * k)));
    bone.rotation.z = amount * 0.3 * Math.cos(1.3 * k);
    mesh.position.y -= bone.position.y / 2;
  });
}

const renderer = new WebGLRenderer({ canvas: document.querySelector("canvas")!, antialias: true, alpha: true });
renderer.toneMapping = NeutralToneMapping;
const scene = new Scene();
scene.environment = new PMREMGenerator(renderer).fromScene(new RoomEnvironment(), 0.03).texture;
const sun = new DirectionalLight(0xfff1dd, 2);
sun.position.set(2, 3, 4);
const camera = new PerspectiveCamera(35, 1, 0.1, 100);
const mesh = tube();
const pivot = new Group().add(mesh);
mesh.frustumCulled = false;
scene.add(sun, pivot);
function resize(): void {
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  renderer.setSize(innerWidth, innerHeight, false);
  camera.aspect = innerWidth / innerHeight;
  const isWide = camera.aspect > 1;
  pivot.rotation.z = isWide ? -1.5 : -0.5;
  camera.position.z = (isWide ? 12 : 7.5) / camera.aspect;
  camera.updateProjectionMatrix();
}
addEventListener("resize", resize);
resize();

const redirected = await redirect(mesh, {
  // One number per texel.
  rigidity: studs.getContext("2d")!.getImageData(0, 0, SIZE, SIZE).data.filter((_, k) => k % 4 === 0),
  size: SIZE,
  grid: 192,
  // Both are found without these where a bundler leaves them beside the package.
  worker: new Worker("worker.js", { type: "module" }),
  wasm: new URL("vrtm_bg.wasm", location.href).href,
});
function wipe(x: number): void {
  redirected.uniforms.wipe.value = x * renderer.getPixelRatio();
  document.querySelector("hr")!.style.left = `${x}px`;
}
addEventListener("pointermove", ({ clientX }) => wipe(clientX));
wipe(innerWidth / 2);

renderer.setAnimationLoop((time) => {
  pose(mesh, mesh.skeleton.bones, 0.5 - 0.5 * Math.cos(time / 1500));
  // The newest pose wins: this one waits, or gives way to that of the next frame.
  redirected.update("draft").then((result) => {
    if (result) {
      document.body.dataset.solved = String(result.reports[0].milliseconds);
    }
  }, (error) => {
    renderer.setAnimationLoop(null);
    document.querySelector("p")!.textContent = error.message;
  });
  renderer.render(scene, camera);
});
