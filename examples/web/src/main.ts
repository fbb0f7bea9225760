/** The page: what is pressed and moved, and what follows of it. */
import { DataUtils, Vector2 } from "three";
import { WorkerAsset } from "vrtm/worker";
import { openScene, poseAt, type Scene } from "./scene.js";
import { MAP, Skin, type Look } from "./skin.js";
import { Surface } from "./surface.js";
import { View } from "./view.js";

const SCENES = {
  jug: { folder: "mug_to_jug", direction: [0.5, 0.35, 1], colours: [[0.008, 0.045, 0.24], [0.86, 0.50, 0.13]], radius: 0.018 },
  creature: { folder: "creature", direction: [1, 0.45, 0.75], colours: [[0.03, 0.17, 0.10], [0.85, 0.74, 0.50]], radius: 0.014 },
} satisfies Record<string, { folder: string; direction: number[]; colours: [number[], number[]]; radius: number }>;
type Name = keyof typeof SCENES;

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const slider = element<HTMLInputElement>("pose");
const status = element("status");
const view = new View(element<HTMLCanvasElement>("view"));

/** What is open. */
interface Open {
  scene: Scene;
  surface: Surface;
  skin: Skin;
  asset: WorkerAsset;
  /** The redirection that is shown, to paint where the pointer is. */
  delta: Uint16Array;
  radius: number;
}
let open: Open | undefined;
let tool: "turn" | "paint" | "erase" = "turn";
let resting: ReturnType<typeof setTimeout> | undefined;
let playing = false;

function say(error: unknown): void {
  status.textContent = error instanceof Error ? error.message : String(error);
  status.classList.add("error");
}

async function show(name: Name): Promise<void> {
  const { folder, direction, colours, radius } = SCENES[name];
  const scene = await openScene(`scenes/${folder}`);
  open?.asset.free();
  open = undefined;
  const surface = new Surface(scene);
  const skin = new Skin(view.renderer, surface.geometry, scene.rigidity, scene.size, colours as [number[], number[]]);
  skin.brushRadius.value = radius;
  skin.look = (document.querySelector("[name=look]:checked") as HTMLInputElement).value as Look;
  view.renderer.setClearColor(0x14171d, 1);
  // The mesh is there before the solver is.
  surface.pose(poseAt(scene, Number(slider.value)));
  view.show(surface, skin, direction);
  const asset = await WorkerAsset.create(scene.mesh, {
    worker: new Worker("worker.js", { type: "module" }),
    wasm: new URL("vrtm_bg.wasm", location.href).href,
  });
  await asset.setRigidity(0, scene.rigidity, scene.size, scene.size);
  open = { scene, surface, skin, asset, radius, delta: new Uint16Array(2 * MAP * MAP) };
  await solve("draft");
  await solve("normal");
}

/** Solves for the pose of the slider, and shows pose and map together once they are there. */
async function solve(quality: "draft" | "normal"): Promise<void> {
  const now = open;
  if (!now) {
    return;
  }
  const positions = poseAt(now.scene, Number(slider.value));
  const start = performance.now();
  const result = await now.asset.redirect(positions, { quality, measure: quality === "normal" }, [
    { tile: 0, kind: "delta", width: MAP, height: MAP, half: true },
  ]);
  if (!result || open !== now) {
    return;
  }
  now.delta = result.images[0] as Uint16Array;
  now.surface.pose(positions);
  now.skin.redirect(now.delta);
  view.draw();
  const [report] = result.reports;
  const { strain } = report;
  const took = `${report.milliseconds.toFixed(0)} ms ${quality} on a grid of ${report.grid.join(" × ")}, ${(performance.now() - start).toFixed(0)} ms with the map`;
  const error = strain ? ` · strain of what is rigid ${strain.before.rms.toFixed(3)} → ${strain.after.rms.toFixed(3)}` : "";
  status.classList.remove("error");
  status.textContent = took + error;
  status.dataset.solved = quality;
}

/** Drafts while something moves, and a whole solve when it rests. */
function moved(): Promise<void> {
  clearTimeout(resting);
  delete status.dataset.solved;
  resting = setTimeout(() => solve("normal").catch(say), 160);
  return solve("draft").catch(say);
}

slider.addEventListener("input", () => {
  playing = false;
  void moved();
});

async function play(): Promise<void> {
  playing = !playing;
  element("play").textContent = playing ? "Pause" : "Play";
  const start = performance.now() - Math.acos(1 - 2 * Number(slider.value)) * 1400;
  while (playing) {
    await new Promise(requestAnimationFrame);
    slider.value = String(0.5 - 0.5 * Math.cos((performance.now() - start) / 1400));
    await moved();
  }
  element("play").textContent = "Play";
}
element("play").addEventListener("click", () => void play());

for (const input of document.querySelectorAll<HTMLInputElement>("[name=look]")) {
  input.addEventListener("change", () => {
    if (open) {
      open.skin.look = input.value as Look;
      view.draw();
    }
  });
}
for (const input of document.querySelectorAll<HTMLInputElement>("[name=tool]")) {
  input.addEventListener("change", () => {
    tool = input.value as typeof tool;
    view.controls.enabled = tool === "turn";
    open?.skin.brush.value.set(-9, -9);
    view.draw();
  });
}
element<HTMLSelectElement>("scene").addEventListener("change", (event) => {
  const chosen = (event.target as HTMLSelectElement).value as Name;
  show(chosen).catch(say);
});

/** Where the pointer is in the painted texture. */
function painted(event: PointerEvent): Vector2 | null {
  const hit = view.pick(event);
  if (!open || !hit) {
    return null;
  }
  if (hit.redirected) {
    const [x, y] = [hit.uv.x, 1 - hit.uv.y].map((t) => Math.min(MAP - 1, Math.max(0, Math.floor(t * MAP))));
    const at = 2 * (y * MAP + x);
    hit.uv.x += DataUtils.fromHalfFloat(open.delta[at]);
    hit.uv.y += DataUtils.fromHalfFloat(open.delta[at + 1]);
  }
  return hit.uv;
}

/** Paints a disc, and returns the part of the map that it changed. */
function dab({ scene: { rigidity, size }, radius }: Open, uv: Vector2, value: number): number[] {
  const [x, y, r] = [uv.x * size - 0.5, (1 - uv.y) * size - 0.5, radius * size];
  const clamp = (n: number) => Math.min(size - 1, Math.max(0, n));
  const [left, right, top, bottom] = [x - r - 1, x + r + 1, y - r - 1, y + r + 1].map((n) => clamp(Math.round(n)));
  for (let j = top; j <= bottom; j++) {
    for (let i = left; i <= right; i++) {
      const inside = Math.min(1, Math.max(0, r + 0.5 - Math.hypot(i - x, j - y)));
      const at = j * size + i;
      rigidity[at] = Math.round(rigidity[at] + (value - rigidity[at]) * inside);
    }
  }
  return [left, top, right - left + 1, bottom - top + 1];
}

const canvas = view.renderer.domElement;
let painting = false;
function stroke(event: PointerEvent): void {
  if (tool === "turn" || !open) {
    return;
  }
  const uv = painted(event);
  open.skin.brush.value.copy(uv ?? new Vector2(-9, -9));
  view.draw();
  if (painting && uv) {
    const { scene, skin, asset } = open;
    const part = dab(open, uv, tool === "paint" ? 255 : 0);
    skin.rigidity.needsUpdate = true;
    asset.updateRigidity(0, scene.rigidity, scene.size, scene.size, part).catch(say);
    void moved();
  }
}
canvas.addEventListener("pointerdown", (event) => {
  painting = tool !== "turn";
  if (painting) {
    canvas.setPointerCapture(event.pointerId);
  }
  stroke(event);
});
canvas.addEventListener("pointermove", stroke);
for (const end of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(end, () => (painting = false));
}

show("jug").catch(say);
