/** The page: what is pressed and moved, and what follows of it. */
import { AnimationMixer, Mesh } from "three";
import { redirect } from "vrtm/three";
import { read, restroke, strokes, write, type Kept } from "./link.js";
import { LOOKS, shared, type Look } from "./looks.js";
import { missing } from "./missing.js";
import { ring } from "./rings.js";
import { puffer, type Ring } from "./scenes.js";
import { Stage } from "./stage.js";
import type { Open } from "./state.js";
import { Loop, measured, percent, words } from "./strain.js";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const { body } = document;
const [slider, message] = [element<HTMLInputElement>("time"), element("message")];

/** What is open, and how it is shown. */
interface Shown extends Open {
  scene: string;
  rings: Ring[];
  /** Rigidity as it came. */
  first: Uint8Array;
  loop: Loop;
}
let open: Shown | undefined;
let stage: Stage;
let playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
/** Seconds: of the newest pose, and of the pose that is shown. */
let [time, shownTime] = [0, 0];
let updates = 0;
let resting: ReturnType<typeof setTimeout> | undefined;

/** A phone's memory: cells of the grid and texels of the map along each side. */
const cells = ((navigator as { deviceMemory?: number }).deviceMemory ?? 8) > 4 ? 384 : 256;

function say(text: unknown, failed = text instanceof Error): void {
  message.textContent = text instanceof Error ? text.message : String(text);
  if (failed) {
    body.dataset.state = "failed";
  }
}

/** Makes a scene, and a worker that prepares it. */
async function prepare(scene: string, kept: Partial<Kept> = {}): Promise<Shown> {
  const { root, clip, rigidity: first, size, texture, rings } = puffer();
  const mixer = new AnimationMixer(root);
  mixer.clipAction(clip).play();
  const meshes = [root.children[0] as Mesh];
  const rigidity = kept.paint ? restroke(kept.paint, first, size) : first.slice();
  const redirected = await redirect(meshes, {
    rigidity, size, grid: cells, mapSize: cells, worker: new Worker("worker.js", { type: "module" }),
    wasm: new URL("vrtm_bg.wasm", location.href).href,
  });
  const parts = [{ meshes, source: redirected.source, redirected, rigidity, size, texture }];
  return { name: "Puffer fish", root, clip: { mixer, duration: clip.duration, name: clip.name }, parts, scene, rings, first, loop: new Loop() };
}

async function show(prepared: Promise<Shown>, kept: Partial<Kept> = {}): Promise<void> {
  say("Getting ready");
  body.dataset.state = "loading";
  close();
  open = await prepared;
  const { clip } = open;
  time = shownTime = Math.min(kept.time ?? 0, clip?.duration ?? 0);
  clip?.mixer.setTime(time);
  slider.max = String(clip?.duration ?? 0);
  slider.value = String(time);
  stage.show(open, kept.view ?? [0.33, 0.17, 0.93]);
  say("One moment: vrtm is solving");
  tell();
  await solve("draft");
  if (!playing) {
    moved();
  }
}

function close(): void {
  stage.close();
  open?.parts.forEach(({ redirected }) => redirected.dispose());
  open = undefined;
  delete body.dataset.solved;
  element<HTMLButtonElement>("worst").disabled = true;
}

/** Solves for the newest time, and shows pose and map together once they are there. */
async function solve(quality: "draft" | "normal"): Promise<void> {
  const now = open;
  if (!now) {
    return;
  }
  const [{ clip, parts: [part], parts }, at] = [now, time];
  clip?.mixer.setTime(at);
  const pose = part.source.pose();
  // To measure takes longer than a draft does.
  const measure = quality === "normal" || updates++ % 4 === 0;
  const results = parts.map(({ redirected }) => redirected.update(quality, { measure }));
  clip?.mixer.setTime(shownTime);
  const all = await Promise.all(results);
  if (open !== now || all.includes(null)) {
    return;
  }
  shownTime = at;
  clip?.mixer.setTime(at);
  ring(part, now.rings, pose);
  stage.solved = true;
  say("");
  body.dataset.state = playing ? "playing" : "still";
  body.dataset.solved = quality;
  const strain = measured(parts);
  if (strain) {
    now.loop.add(at, strain);
    element("numbers").textContent = words(strain);
    const shares = { ".without b": strain.before, ".with b": strain.after };
    Object.entries(shares).forEach(([name, share]) => (document.querySelector(name)!.textContent = `${percent(share)} stretched`));
    element<HTMLButtonElement>("worst").disabled = now.loop.worst() === null;
  }
  layout();
  stage.draw();
}

const drawn = () => new Promise((resolve) => element("view").addEventListener("drawn", resolve, { once: true }));

/** Drafts while something moves, and a whole solve when it rests. */
function moved(): void {
  clearTimeout(resting);
  delete body.dataset.solved;
  body.dataset.solved = "draft";
  resting = setTimeout(() => void solve("normal").catch(say), 160);
  solve("draft").catch(say);
}

async function run(): Promise<void> {
  for (let last = performance.now(); ; ) {
    await new Promise(requestAnimationFrame);
    const now = performance.now();
    if (playing && open?.clip) {
      // A clock that stands while the tab is hidden, and goes slow where pictures take long.
      time = (time + Math.min((now - last) / 1000, 0.12)) % open.clip.duration;
      slider.value = String(time);
      await solve("draft").catch(say);
      if (open) {
        await drawn();
      }
    }
    last = now;
  }
}

function play(on: boolean): void {
  playing = on;
  element("play").textContent = on ? "Pause" : "Play";
  if (!on) {
    moved();
  }
}

function seek(to: number): void {
  time = to;
  slider.value = String(to);
  play(false);
}

/** Bytes that are held for what is open: textures, meshes, and per node and triangle of the solver. */
function tell(): void {
  const bytes = (open?.parts ?? []).reduce((sum, { source: { mesh }, rigidity, texture }) =>
    sum + 157 * cells * cells + 4 * cells * cells + 116 * (mesh.indices.length / 3) + 3 * rigidity.length + (texture ? 3 * 1.33 * texture.data.length : 0), 0);
  element("memory").textContent = `Solved on ${cells} × ${cells} cells, with about ${Math.ceil(bytes / 1e6)} MB.`;
}

function wipeTo(share: number): void {
  stage.wipe = Math.min(0.97, Math.max(0.03, share));
  layout();
  stage.draw();
}

function layout(): void {
  const { clientWidth: width, clientHeight: height } = stage.canvas;
  const side = stage.compare === "side";
  body.dataset.panes = side && body.dataset.solved ? (width >= height ? "beside" : "stacked") : "one";
  const share = side ? 0.5 : stage.wipe;
  element("stage").style.setProperty("--wipe", body.dataset.solved ? `${100 * share}%` : "100%");
  element("wipe").setAttribute("aria-valuenow", (100 * share).toFixed(0));
}

function look(name: Look): void {
  shared.look.value = LOOKS.indexOf(name);
  element("legend").hidden = name !== "strain";
  stage.draw();
}

/** Where the pointer is moves the wipe; pressed, it turns the character. */
function pointers(): void {
  const { canvas } = stage;
  const share = ({ clientX }: PointerEvent) => {
    const { left, width } = canvas.getBoundingClientRect();
    return (clientX - left) / width;
  };
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons === 0 && event.pointerType === "mouse" && stage.controls.enabled) {
      wipeTo(share(event));
    }
  });
  const handle = element("wipe");
  handle.addEventListener("pointerdown", ({ pointerId }) => handle.setPointerCapture(pointerId));
  handle.addEventListener("pointermove", (event) => {
    if (event.buttons > 0 || event.pointerType === "mouse") {
      wipeTo(share(event));
    }
  });
}

function keys(): void {
  const arrow = ({ key }: KeyboardEvent) => [Number(key === "ArrowRight") - Number(key === "ArrowLeft"), Number(key === "ArrowUp") - Number(key === "ArrowDown")];
  element("wipe").addEventListener("keydown", (event) => wipeTo(stage.wipe + 0.02 * arrow(event)[0]));
  stage.canvas.addEventListener("keydown", (event) => {
    const [x, y] = arrow(event);
    stage.turn(0.1 * x, 0.1 * y);
  });
  addEventListener("keydown", (event) => {
    const on = event.target as HTMLElement;
    if (event.key === " " && !on.matches("button, select, summary, input:not([type=range])")) {
      event.preventDefault();
      play(!playing);
    } else if (event.key.startsWith("Arrow") && on === body && open?.clip) {
      const step = arrow(event)[0] / 24;
      seek((time + step + open.clip.duration) % open.clip.duration);
    }
  });
}

async function copyLink(): Promise<void> {
  const [part] = open!.parts;
  const chosen = (name: string) => document.querySelector<HTMLInputElement>(`[name=${name}]:checked`)!.value;
  const kept: Kept = {
    scene: open!.scene, time: shownTime, view: stage.view(), look: chosen("look"), compare: stage.compare, wipe: stage.wipe,
    lines: shared.lines.value > 0, paint: strokes(part.rigidity, open!.first, part.size),
  };
  history.replaceState(null, "", `#${write(kept)}`);
  await navigator.clipboard?.writeText(location.href).catch(() => undefined);
  element("link").textContent = "The link is copied, and in the address";
}

function choose(name: string, value: string | undefined): void {
  const input = document.querySelector<HTMLInputElement>(`[name=${name}][value="${CSS.escape(value ?? "")}"]`);
  if (input) {
    input.checked = true;
    input.dispatchEvent(new Event("change"));
  }
}

function start(): void {
  const kept = read(location.hash);
  // The worker prepares while lights are made.
  const prepared = prepare("puffer", kept);
  stage = new Stage(element<HTMLCanvasElement>("view"));
  const each = (name: string, call: (value: string) => void) =>
    document.querySelectorAll<HTMLInputElement>(`[name=${name}]`).forEach((input) => input.addEventListener("change", () => call(input.value)));
  each("look", (value) => look(value as Look));
  each("compare", (value) => {
    stage.compare = body.dataset.compare = value as "wipe" | "side";
    layout();
    stage.draw();
  });
  element("lines").addEventListener("change", ({ target }) => {
    shared.lines.value = Number((target as HTMLInputElement).checked);
    stage.draw();
  });
  element("play").addEventListener("click", () => play(!playing));
  slider.addEventListener("input", () => seek(Number(slider.value)));
  element("worst").addEventListener("click", () => seek(open!.loop.worst()!));
  element("link").addEventListener("click", () => void copyLink().catch(say));
  stage.canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    say("The graphics card is busy elsewhere; the picture comes back as soon as it may.", true);
  });
  stage.canvas.addEventListener("webglcontextrestored", () => {
    say("");
    moved();
  });
  new ResizeObserver(layout).observe(stage.canvas);
  pointers();
  keys();
  choose("look", kept.look);
  choose("compare", kept.compare);
  if (kept.lines) {
    element("lines").click();
  }
  stage.wipe = kept.wipe ?? 0.5;
  if (kept.time !== undefined) {
    play(false);
  }
  show(prepared, kept).catch(say);
  void run();
}

const lack = missing();
if (lack) {
  say(lack, true);
} else {
  start();
}
