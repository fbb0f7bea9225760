/** The page: what is pressed and moved, and what follows of it. */
import { mount as mountFiles, type Named } from "./files.js";
import { hands } from "./hands.js";
import { read, restroke, strokes, write, type Kept } from "./link.js";
import { LOOKS, shared, type Look } from "./looks.js";
import { missing } from "./missing.js";
import { dispose, memory, openFiles, play as playClip } from "./own.js";
import { mount as mountPaint } from "./paint.js";
import { ring } from "./rings.js";
import { SCENES, openScene, type Scene } from "./scenes.js";
import { Stage } from "./stage.js";
import { Loop, measured, tell } from "./strain.js";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const { body } = document;
const [slider, message] = [element<HTMLInputElement>("time"), element("message")];

/** What is open: rigidity as it came, and measures of its loop. */
interface Shown extends Scene {
  scene: string;
  first: Uint8Array[];
  loop: Loop;
}
let open: Shown | undefined;
let stage: Stage;
let hand: ReturnType<typeof hands>;
const isCalm = matchMedia("(prefers-reduced-motion: reduce)").matches;
let playing = !isCalm;
/** Seconds: of the newest pose, and of the pose that is shown. */
let [time, shownTime] = [0, 0];
let updates = 0;
let turns = 0;
let resting: ReturnType<typeof setTimeout> | undefined;

/** Errors stay until something is pressed. */
function say(text: unknown): void {
  message.textContent = text instanceof Error ? text.message : String(text);
  message.classList.toggle("error", text instanceof Error);
}

const opened = (made: Scene, scene: string): Shown =>
  ({ ...made, scene, first: made.parts.map(({ rigidity }) => rigidity.slice()), loop: new Loop() });

/** A built-in scene, with the paint of a link. */
async function prepare(scene: string, { paint }: Partial<Kept> = {}): Promise<Shown> {
  const shown = opened(await openScene(scene, (root) => {
    if (!open) {
      stage.show(root, SCENES[scene].direction);
      say("Getting ready: vrtm is on its way");
    }
  }), scene);
  if (paint) {
    const [{ rigidity, size, redirected }] = shown.parts;
    rigidity.set(restroke(paint, shown.first[0], size));
    await redirected.setRigidity(rigidity, size);
  }
  return shown;
}

/** Characters of the visitor's are not painted yet. */
async function own(files: Promise<Named[]>): Promise<Shown> {
  const made = await openFiles(await files);
  const sentence = `${made.name}: choose what keeps its shape under “Paint”. The file stays on this device.`;
  return opened({ ...made, sentence, direction: [0.3, 0.15, 0.94], rings: [] }, "own");
}

/** Shows what is opened next, unless something else is before it is ready; what was open stays until then, or if this
 * fails. */
async function show(opening: Promise<Shown>, kept: Partial<Kept> = {}): Promise<void> {
  const turn = ++turns;
  say("Getting ready");
  try {
    const made = await opening;
    await (turn === turns ? enter(made, kept) : dispose(made));
  } catch (error) {
    if (turn === turns) {
      element<HTMLSelectElement>("scene").value = open?.scene ?? "";
      say(error);
    }
  }
}

async function enter(made: Shown, kept: Partial<Kept>): Promise<void> {
  if (open && !isCalm) {
    play(true);
  }
  close();
  open = made;
  const { clip, clips, notes, parts } = made;
  time = shownTime = Math.min(kept.time ?? 0, clip?.duration ?? 0);
  clip?.mixer.setTime(time);
  slider.disabled = !clip;
  slider.max = String(clip?.duration ?? 0);
  slider.value = String(time);
  element("sentence").textContent = made.sentence;
  element("rings").hidden = made.rings.length === 0;
  element<HTMLSelectElement>("clip").replaceChildren(...clips.map(({ name }, k) => new Option(name, String(k))));
  element("clip").hidden = clips.length < 2;
  element("link").hidden = made.scene === "own";
  element<HTMLSelectElement>("scene").value = made.scene;
  stage.show(made.root, kept.view ?? made.direction);
  stage.dress(parts);
  say("One moment: vrtm is solving");
  element("notes").textContent = [...notes, await memory(parts)].join(" ");
  await solve("draft");
  if (!playing || !clip) {
    moved();
  }
}

function close(): void {
  stage.close();
  if (open) {
    dispose(open);
  }
  open = undefined;
  delete body.dataset.solved;
  element<HTMLButtonElement>("worst").disabled = true;
  document.querySelectorAll(".without b, .with b, #numbers").forEach((figure) => (figure.textContent = ""));
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
  if (quality === "normal" || updates > 4) {
    stage.light();
  }
  ring(part, now.rings, pose);
  stage.solved = true;
  if (!message.classList.contains("error")) {
    say("");
  }
  body.dataset.state = playing ? "playing" : "still";
  body.dataset.solved = quality;
  if (measure) {
    const strain = measured(parts);
    if (strain) {
      now.loop.add(at, strain);
    }
    tell(strain);
    element<HTMLButtonElement>("worst").disabled = now.loop.worst() === null;
  }
  hand.layout();
  stage.draw();
}

const drawn = () => new Promise((resolve) => element("view").addEventListener("drawn", resolve, { once: true }));

/** Drafts while something moves, and a whole solve when it rests. */
function moved(): void {
  clearTimeout(resting);
  body.dataset.solved &&= "draft";
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

function look(name: Look): void {
  shared.look.value = LOOKS.indexOf(name);
  element("legend").hidden = name !== "strain";
  stage.draw();
}

async function copyLink(): Promise<void> {
  const [part] = open!.parts;
  const chosen = (name: string) => document.querySelector<HTMLInputElement>(`[name=${name}]:checked`)!.value;
  const kept: Kept = {
    scene: open!.scene, time: shownTime, view: stage.view(), look: chosen("look"), compare: stage.compare,
    wipe: stage.wipe, lines: shared.lines.value > 0, paint: strokes(part.rigidity, open!.first[0], part.size),
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
  document.querySelector("details")!.open = innerWidth > 760;
  const kept = read(location.hash);
  const scene = kept.scene && kept.scene in SCENES ? kept.scene : "puffer";
  // Files are fetched while lights are made.
  const prepared = prepare(scene, kept);
  stage = new Stage(element<HTMLCanvasElement>("view"));
  const each = (name: string, call: (value: string) => void) =>
    document.querySelectorAll<HTMLInputElement>(`[name=${name}]`).forEach((input) =>
      input.addEventListener("change", () => call(input.value)));
  each("look", (value) => look(value as Look));
  each("compare", (value) => {
    stage.compare = body.dataset.compare = value as "wipe" | "side";
    hand.layout();
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
    say(new Error("The graphics card was taken away; the picture comes back as soon as it may."));
  });
  stage.canvas.addEventListener("webglcontextrestored", () => {
    say("");
    moved();
  });
  const scenes = element<HTMLSelectElement>("scene");
  scenes.append(...Object.entries(SCENES).map(([id, { name }]) => new Option(name, id, false, id === scene)));
  scenes.append(Object.assign(new Option("Your own", "own"), { disabled: true }));
  scenes.addEventListener("change", () => void show(prepare(scenes.value)));
  element("choose").addEventListener("click", () => element("file").click());
  mountFiles(body, element<HTMLInputElement>("file"), (files) => void show(own(files)));
  element<HTMLSelectElement>("clip").addEventListener("change", ({ target }) => {
    playClip(open!, open!.clips[Number((target as HTMLSelectElement).value)]);
    open!.loop = new Loop();
    slider.max = String(open!.clip!.duration);
    seek(0);
    play(true);
  });
  addEventListener("pointerdown", () => message.classList.contains("error") && say(""));
  const pause = () => playing && play(false);
  const brush = mountPaint(element("paint"), stage, { open: () => open, changed: moved, pause, say });
  // What is read by few need not be loaded by all.
  const take = element("take");
  take.closest("details")!.addEventListener("toggle", () => void import("./take.js")
    .then(({ mount }) => take.hasChildNodes() || mount(take, () => open)).catch(say));
  hand = hands(stage, {
    isPainting: brush.isOn,
    play: () => play(!playing),
    step: (seconds) => open?.clip && seek((time + seconds + open.clip.duration) % open.clip.duration),
  });
  new ResizeObserver(hand.layout).observe(stage.canvas);
  choose("look", kept.look);
  choose("compare", kept.compare);
  if (kept.lines) {
    element("lines").click();
  }
  hand.wipeTo(kept.wipe ?? 0.5);
  if (kept.time !== undefined) {
    play(false);
  }
  void show(prepared, kept);
  void run();
}

// For the console of a browser.
Object.defineProperty(globalThis, "character", { get: () => open });

const lack = missing();
if (lack) {
  body.dataset.state = "missing";
  say(new Error(lack));
} else {
  start();
}
