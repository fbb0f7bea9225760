/** Downloads: files of the frame that is shown, and of the clip that plays. */
import { zipSync, type Zippable } from "three/addons/libs/fflate.module.js";
import { fitBasis } from "vrtm/three";
import { exr, png, usda } from "./formats.js";
import { glb, morphing, type Morphing } from "./morphs.js";
import type { Open, Part } from "./state.js";

/** Frames per second, and the most of a clip: longer ones have fewer per second. */
const RATE = 24;
const FRAMES = 96;
/** Texels of a basis map per side; the largest error of a sum, in texels of a texture. */
const SIZE = 256;
const [MOST, TEXTURE] = [8, 4096];

/** Says what is under way, lets the page draw, and throws if the visitor has cancelled it. */
type Tick = (words: string) => Promise<void>;
interface Made {
  files: Zippable;
  note: string;
}
type Make = (open: Open, tick: Tick) => Promise<Made>;

/** Names of parts, which prims in USD may have. */
function names({ name, parts }: Open): string[] {
  const found = parts.map(({ meshes }) => (meshes[0].name || name).replace(/\W/g, "_").replace(/^(?=\d)/, "_"));
  return found.map((one, k) => (found.indexOf(one) === k ? one : `${one}_${k + 1}`));
}

const text = (words: string) => new TextEncoder().encode(words);

/** The redirection of the frame that is shown, as `vrtm bake` has it with `--form tile`. */
async function map(open: Open, tick: Tick): Promise<Made> {
  const files: Zippable = {};
  const { parts } = open;
  const poses = parts.map(({ source }) => source.pose());
  for (const [k, name] of names(open).entries()) {
    await tick(`Solving ${name}`);
    const size = parts[k].redirected.mapSize;
    const fetch = { tile: 0, kind: "uv", width: size, height: size } as const;
    const result = await parts[k].redirected.asset.redirect(poses[k], { replace: false }, [fetch]);
    files[`${name}.redirect.1001.exr`] = await exr(size, result!.images[0] as Float32Array);
  }
  return { files, note: "u in red, v in green, v up." };
}

/** Poses of each part in the frames of the clip, which then stands where it stood. */
function frames({ clip, parts }: Open): { times: number[]; poses: Float32Array[][]; rate: number } {
  if (!clip) {
    return { times: [0], poses: parts.map(({ source }) => [source.pose()]), rate: RATE };
  }
  const { mixer, duration } = clip;
  const rate = Math.min(RATE, (FRAMES - 1) / duration);
  const times = Array.from({ length: Math.floor(duration * rate + 1e-6) + 1 }, (_, k) => k / rate);
  const now = mixer.time;
  const at = times.map((time) => {
    // At its end a clip begins again.
    mixer.setTime(Math.min(time, duration - 1e-4));
    return parts.map(({ source }) => source.pose());
  });
  mixer.setTime(now);
  return { times, rate, poses: parts.map((_, p) => at.map((pose) => pose[p])) };
}

function basisOf({ redirected }: Part, name: string, poses: Float32Array[], tick: Tick) {
  const words = (solved: number) => (solved < poses.length ? `frame ${solved + 1} of ${poses.length}` : "fitting maps");
  const options = { size: SIZE, bound: MOST / TEXTURE, tick: (solved: number) => tick(`${name}: ${words(solved)}`) };
  return fitBasis(redirected, poses, options);
}

/** Basis maps with their weights, in the files of `vrtm bake --basis`. */
async function basis(open: Open, tick: Tick): Promise<Made> {
  const files: Zippable = {};
  const notes: string[] = [];
  const { poses } = frames(open);
  for (const [p, name] of names(open).entries()) {
    const { maps, weights, errors } = await basisOf(open.parts[p], name, poses[p], tick);
    const prefix = open.parts.length > 1 ? `${name}.` : "";
    const images = maps.map((_, k) => `${prefix}basis.${String(k).padStart(4, "0")}.1001.exr`);
    for (const [k, image] of images.entries()) {
      files[image] = await exr(SIZE, maps[k]);
    }
    const document = {
      program: { name: "vrtm page" }, mesh: name, maps: maps.length,
      max_error: MOST, texture_size: TEXTURE, format: "half",
      ranges: maps.map(() => ({ offset: [0, 0], scale: [1, 1] })),
      frames: weights.map((of, f) => ({ frame: f + 1, weights: of, error: errors[f] * TEXTURE })),
      files: [{ udim: 1001, layer: 0, size: [SIZE, SIZE], maps: images }],
    };
    files[`${prefix}basis.json`] = text(JSON.stringify(document, null, 1));
    notes.push(`${name}: ${maps.length} maps for ${weights.length} frames`);
  }
  return { files, note: `${notes.join("; ")}; off by ${MOST} texels of ${TEXTURE} at most.` };
}

/** The meshes with morph targets of positions and UVs that the same weights drive, as `vrtm bake --gltf` has them. */
async function morphs(open: Open, tick: Tick): Promise<Made> {
  const { times, poses } = frames(open);
  const all: Morphing[] = [];
  const notes: string[] = [];
  for (const [p, name] of names(open).entries()) {
    const made = await basisOf(open.parts[p], name, poses[p], tick);
    const wait = () => tick(`${name}: fitting shapes`);
    const { meshes, shapes, error } = await morphing(open.parts[p], name, poses[p], made, wait);
    all.push(...meshes);
    const off = `between vertices off by ${(error * TEXTURE).toFixed(0)} texels of ${TEXTURE}`;
    notes.push(`${name}: ${made.maps.length} targets with UVs, ${off}, ${shapes} of shape alone`);
  }
  await tick("Writing");
  return { files: { "basis.glb": await glb(all, times) }, note: notes.join("; ") };
}

/** Paint, the clip as a USD scene, and the page's settings, of which `vrtm bake` makes the page's maps. */
async function settings(open: Open, tick: Tick): Promise<Made> {
  await tick("Writing");
  const { parts } = open;
  const { rate, poses } = frames(open);
  const grids = await Promise.all(parts.map(({ redirected }) => redirected.asset.grid(0)));
  const maps = parts.map(({ redirected }) => redirected.mapSize);
  const prefixes = names(open).map((name) => (parts.length > 1 ? `${name}.` : ""));
  const options = `--rigidity '${parts.length > 1 ? "<mesh>." : ""}rigidity.<UDIM>.png' --rest pref --uv st
--size ${Math.max(...grids.flat())} --map-size ${Math.max(...maps)}
--seams shut --open-borders fixed --overlap fixed --quality normal --scale keep
`;
  const moving = names(open).map((name, p) => ({ name, mesh: parts[p].source.mesh, poses: poses[p] }));
  const files: Zippable = { "scene.usda": text(usda(moving, rate)), "bake.txt": text(options) };
  for (const [p, { rigidity, size }] of parts.entries()) {
    files[`${prefixes[p]}rigidity.1001.png`] = await png(size, rigidity);
  }
  return { files, note: "In its folder: vrtm bake scene.usda --settings bake.txt --out maps" };
}

const BUTTONS: [name: string, title: string, needsClip: boolean, make: Make][] = [
  ["Map", "The redirection of this frame, as EXR", false, map],
  ["Basis maps", "A few maps for all frames with their weights, for game engines", true, basis],
  ["glTF", "The meshes, with UVs that move as morph targets", true, morphs],
  ["For vrtm bake", "Paint, motion and settings, for the command line", false, settings],
];

/** Builds the buttons, and a line that says what becomes of them; `open` gives what is open. */
export function mount(panel: HTMLElement, open: () => Open | undefined): void {
  const made = (name: string, title = "", hidden = false) =>
    Object.assign(document.createElement("button"), { type: "button", textContent: name, title, hidden });
  const said = document.createElement("output");
  const cancel = made("Cancel", "", true);
  let ending: AbortController | undefined;
  cancel.addEventListener("click", () => ending?.abort());
  const run = async (make: Make, now: Open, kind: string) => {
    const { signal } = (ending = new AbortController());
    cancel.hidden = false;
    try {
      const { files, note } = await make(now, async (words) => {
        said.textContent = words;
        await new Promise((resolve) => setTimeout(resolve));
        signal.throwIfAborted();
      });
      const [[only, bytes], ...more] = Object.entries(files);
      const zip = more.length > 0 ? zipSync(files) : (bytes as Uint8Array);
      const ending = more.length > 0 ? `${kind.toLowerCase().replace(/\W+/g, "_")}.zip` : only;
      const download = `${now.name.replace(/\.\w+$/, "").replace(/[^\w-]/g, "_")}.${ending}`;
      const href = URL.createObjectURL(new Blob([zip as BlobPart]));
      Object.assign(document.createElement("a"), { href, download }).click();
      setTimeout(() => URL.revokeObjectURL(href), 60_000);
      said.textContent = `${download}, ${(zip.length / 1e6).toFixed(1)} MB. ${note}`;
    } catch (error) {
      said.textContent = signal.aborted ? "Cancelled." : (error as Error).message;
    }
    ending = undefined;
    cancel.hidden = true;
  };
  const buttons = BUTTONS.map(([name, title, needsClip, make]) => {
    const button = made(name, title);
    button.addEventListener("click", () => {
      const now = open();
      if (now && (now.clip || !needsClip)) {
        void (ending ?? run(make, now, name));
      } else {
        said.textContent = now ? "This needs a clip that plays." : "Nothing is open.";
      }
    });
    return button;
  });
  panel.append(...buttons, cancel, said);
}
