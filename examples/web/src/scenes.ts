/** Built-in scenes: a puffer fish that is made here, swims, breathes and has round scales and eyes; and two files. */
import {
  AnimationClip, BufferAttribute, BufferGeometry, Color, DataTexture, DoubleSide, Group, LinearFilter,
  LinearMipmapLinearFilter, Mesh, MeshStandardMaterial, NumberKeyframeTrack, RepeatWrapping, SRGBColorSpace, Vector3,
  type Object3D,
} from "three";
import { mergeGeometries } from "three/addons/utils/BufferGeometryUtils.js";
import { redirect } from "vrtm/three";
import { limits } from "./files.js";
import { openFiles, play, type Own } from "./own.js";

/** Texels of the textures along each side. */
const SIZE = 1024;
/** Cells of the grids and texels of the maps along each side: scenes play smoothly with them. */
const CELLS = Math.min(limits().grid || 384, 384);
/** Circles of the surface at rest that rings mark. */
export interface Ring {
  uv: [number, number];
  radius: number;
}
interface Pose {
  breath: number;
  bend: number;
}
type Point = (s: number, t: number, pose: Pose) => Vector3;
/** Discs of an eye: radii and colours. */
const EYE = [
  [1.16, 12, 40, 52], [1, 250, 250, 245], [0.64, 226, 122, 24], [0.56, 246, 160, 44], [0.32, 12, 12, 16],
];
const POSES: Pose[] = [{ breath: 0, bend: 0 }, { breath: 1, bend: 0 }, { breath: 0, bend: 1 }];
const hump = (s: number, skew: number, power: number) => Math.max(Math.sin(Math.PI * s ** skew), 0) ** power;
const mix = (from: number, to: number, share: number) => from + (to - from) * share;
const smooth = (from: number, to: number, x: number) => {
  const t = Math.min(Math.max((x - from) / (to - from), 0), 1);
  return t * t * (3 - 2 * t);
};

/** The tail swings to the side. */
function swim(point: Vector3, { bend }: Pose): Vector3 {
  point.z += bend * 0.14 * Math.max(0.55 - point.x, 0) ** 2;
  return point;
}

/** The skin: s from the tail to the mouth, t from the belly around over the side and the back. */
const body: Point = (s, t, pose) => {
  const around = 2 * Math.PI * (t % 1);
  const belly = 1 + 0.22 * pose.breath * hump(s, 1.15, 1.5) * smooth(0.2, -1, -Math.cos(around));
  const radius = 0.075 + 0.34 * hump(s, 1.2, 0.95) + 0.35 * pose.breath * hump(s, 1.1, 0.9);
  const [y, z] = [-Math.cos(around) * radius * belly, Math.sin(around) * radius * mix(0.8, 0.95, pose.breath)];
  return swim(new Vector3(2.1 * s - 1.05, y, z), pose);
};

/** A sheet of points with its poses as morph targets; normals are those of the surface that the points lie on. */
function sheet(columns: number, rows: number, at: Point, colour?: (s: number, t: number) => Color): BufferGeometry {
  const geometry = new BufferGeometry();
  const count = (columns + 1) * (rows + 1);
  const [uvs, colours, index]: number[][] = [[], [], []];
  const [positions, normals] = [POSES, POSES].map((poses) => poses.map(() => new Float32Array(3 * count)));
  const h = 1e-3;
  for (let k = 0; k < count; k++) {
    const [s, t] = [Math.floor(k / (columns + 1)) / rows, (k % (columns + 1)) / columns];
    uvs.push(0.01 + 0.98 * t, 0.01 + 0.98 * s);
    colour?.(s, t).toArray(colours, 3 * k);
    for (const [p, pose] of POSES.entries()) {
      at(s, t, pose).toArray(positions[p], 3 * k);
      const along = at(Math.min(s + h, 1), t, pose).sub(at(Math.max(s - h, 0), t, pose));
      along.cross(at(s, t + h, pose).sub(at(s, t - h, pose))).normalize().toArray(normals[p], 3 * k);
    }
    if (s < 1 && t < 1) {
      const next = k + columns + 1;
      index.push(k, next, next + 1, k, next + 1, k + 1);
    }
  }
  geometry.setIndex(index);
  geometry.morphTargetsRelative = true;
  for (const [name, [rest, ...others]] of Object.entries({ position: positions, normal: normals })) {
    geometry.setAttribute(name, new BufferAttribute(rest, 3));
    geometry.morphAttributes[name as "position"] =
      others.map((values) => new BufferAttribute(values.map((x, k) => x - rest[k]), 3));
  }
  geometry.setAttribute("uv", new BufferAttribute(Float32Array.from(uvs), 2));
  if (colour) {
    geometry.setAttribute("color", new BufferAttribute(Float32Array.from(colours), 3));
  }
  return geometry;
}

/** Fins and lips. */
function trim(): BufferGeometry {
  const fin = (s: number, t: number) =>
    new Color(0x9c3d12).lerp(new Color(0xf6a93b), 0.15 + 0.6 * s + 0.25 * Math.sin(t * 44));
  const ripple = (s: number, t: number) => 0.025 * s * Math.sin(t * 44);
  const tail: Point = (s, t, pose) => {
    const across = 2 * t - 1;
    const length = 0.62 * s * (0.72 + 0.28 * across * across);
    return swim(new Vector3(-0.98 - length, across * (0.07 + 0.44 * s), ripple(s, t)), pose);
  };
  const ridge = (from: number, to: number, around: number, height: number): Point => (s, t, pose) => {
    const root = body(mix(from, to, t), around, pose);
    const up = height * s * hump(0.12 + 0.8 * t, 1, 0.6);
    return root.add(new Vector3(-0.6 * up - 0.02, around ? up : -up, ripple(s, t))).lerp(body(0.4, around, pose), 0.03);
  };
  const side = (sign: number): Point => (s, t, pose) => {
    const root = body(0.58, 0.5 - sign * 0.27, pose);
    const [turn, reach] = [mix(-0.75, 0.5, t), 0.3 * s * (0.8 + 0.2 * Math.sin(Math.PI * t))];
    const away = sign * (0.55 * reach + ripple(s, t) + 0.12 * pose.bend * s);
    return root.add(new Vector3(-Math.cos(turn) * reach, Math.sin(turn) * reach + 0.03 * (t - 0.5), away));
  };
  const lips: Point = (s, t, pose) => {
    const [round, around] = [2 * Math.PI * s, 2 * Math.PI * t];
    const radius = 0.062 + 0.034 * Math.cos(round);
    const [y, z] = [-radius * Math.cos(around), 0.9 * radius * Math.sin(around)];
    return swim(new Vector3(1.045 - 0.034 * Math.sin(round), y, z), pose);
  };
  const throat: Point = (s, t) =>
    new Vector3(1.03, -0.06 * s * Math.cos(2 * Math.PI * t), 0.06 * s * Math.sin(2 * Math.PI * t));
  return mergeGeometries([
    sheet(48, 10, tail, fin), sheet(36, 6, ridge(0.26, 0.58, 0.5, 0.24), fin),
    sheet(30, 6, ridge(0.16, 0.36, 0, 0.16), fin), sheet(28, 8, side(1), fin), sheet(28, 8, side(-1), fin),
    sheet(28, 10, lips, () => new Color(0xc9705f)), sheet(12, 1, throat, () => new Color(0x1a0c0c)),
  ]);
}

/** Textures of the skin, what of it is rigid, and its scales. */
function paint(): { colour: Uint8ClampedArray; relief: Uint8Array; rigidity: Uint8Array; scales: Ring[] } {
  const [colour, relief] = [new Uint8ClampedArray(4 * SIZE * SIZE), new Uint8Array(4 * SIZE * SIZE)];
  const rigidity = new Uint8Array(SIZE * SIZE);
  const rest = POSES[0];
  const at = (x: number) => ((x + 0.5) / SIZE - 0.01) / 0.98;
  const texel = (k: number, rgb: readonly number[], share: number) => {
    for (let c = 0; c < 3; c++) {
      colour[4 * k + c] = mix(colour[4 * k + c], rgb[c], share);
    }
  };
  for (let k = 0; k < SIZE * SIZE; k++) {
    const [t, s] = [at(k % SIZE), at(Math.floor(k / SIZE))];
    const height = 0.5 - 0.5 * Math.cos(2 * Math.PI * t);
    const [across, along] = [38 * Math.PI * t + 3 * Math.sin(23 * s), 61 * s + 2 * Math.sin(14 * Math.PI * t)];
    const mottle = Math.sin(across) * Math.sin(along);
    colour.set([mix(150, 22, smooth(0.05, 0.8, height)), mix(196, 78, smooth(0, 0.9, height)) + 9 * mottle,
      mix(188, 104, smooth(0, 0.95, height)) + 9 * mottle, 255], 4 * k);
    relief.set([100 + 6 * mottle, 110, 0, 255], 4 * k);
  }
  /** Calls back for the texels of a disc on the surface at rest, with the distance as a share of the radius. */
  const disc = (s0: number, t0: number, radius: number, put: (k: number, away: number) => void) => {
    const center = body(s0, t0, rest);
    const ring = 2 * Math.PI * Math.max(Math.hypot(center.y, center.z), 0.05);
    const [high, wide] = [(1.3 * radius) / 2.1, (1.5 * radius) / ring].map((r) => Math.ceil(r * SIZE));
    const [x0, y0] = [t0, s0].map((x) => Math.round((0.01 + 0.98 * x) * SIZE - 0.5));
    for (let y = Math.max(y0 - high, 0); y <= Math.min(y0 + high, SIZE - 1); y++) {
      for (let x = Math.max(x0 - wide, 0); x <= Math.min(x0 + wide, SIZE - 1); x++) {
        const away = body(at(y), at(x), rest).distanceTo(center) / radius;
        if (away < 1.3) {
          put(y * SIZE + x, away);
        }
      }
    }
  };
  const scales: Ring[] = [];
  const eyes = [0.29, 0.71].map((t) => body(0.8, t, rest));
  for (let s = 0.1, row = 0; s < 0.9; row++) {
    const radius = 0.022 + 0.038 * hump(s, 1.05, 0.8);
    const around = Math.round((2 * Math.PI * body(s, 0.5, rest).y * 0.9) / (2.85 * radius));
    for (let k = 0; k < around; k++) {
      const t = (k + (row % 2 ? 0.5 : 0)) / around;
      const center = body(s, t, rest);
      // A scale on the seam would be cut there.
      if (Math.min(t, 1 - t) < 0.6 / around || eyes.some((eye) => eye.distanceTo(center) < 0.15 + radius)) {
        continue;
      }
      scales.push({ uv: [0.01 + 0.98 * t, 0.01 + 0.98 * s], radius });
      disc(s, t, radius, (k, away) => {
        const inside = smooth(1.02, 0.96, away);
        texel(k, [16, 52, 66], 0.75 * smooth(1.28, 1.02, away));
        texel(k, [mix(252, 214, away * away), mix(226, 160, away * away), mix(160, 78, away * away)], inside);
        relief[4 * k] = mix(relief[4 * k], 120 + 130 * Math.sqrt(Math.max(1 - away * away, 0)), inside);
        relief[4 * k + 1] = mix(relief[4 * k + 1], 70, inside);
        rigidity[k] = Math.max(rigidity[k], 255 * smooth(1.24, 1.08, away));
      });
    }
    s += (2.55 * radius) / 2.1;
  }
  for (const t of [0.29, 0.71]) {
    disc(0.8, t, 0.105, (k, away) => {
      for (const [edge, ...rgb] of EYE) {
        texel(k, rgb, smooth(edge + 0.02, edge - 0.02, away));
      }
      relief[4 * k] = mix(relief[4 * k], 90 + 165 * Math.sqrt(Math.max(1 - away * away, 0)), smooth(1.05, 0.95, away));
      relief[4 * k + 1] = mix(relief[4 * k + 1], 20, smooth(1.05, 0.95, away));
      rigidity[k] = Math.max(rigidity[k], 255 * smooth(1.28, 1.16, away));
    });
  }
  return { colour, relief, rigidity, scales };
}

/** The fish and its motion, painted. */
async function puffer(early: Early): Promise<Scene> {
  const { colour, relief, rigidity, scales } = paint();
  const texture = (data: Uint8ClampedArray | Uint8Array) => {
    const made = new DataTexture(data, SIZE, SIZE);
    Object.assign(made, { magFilter: LinearFilter, minFilter: LinearMipmapLinearFilter, anisotropy: 4 });
    made.wrapS = RepeatWrapping;
    made.generateMipmaps = made.needsUpdate = true;
    return made;
  };
  const [map, surface] = [texture(colour), texture(relief)];
  map.colorSpace = SRGBColorSpace;
  const skin = new MeshStandardMaterial({ map, roughnessMap: surface, roughness: 1, bumpMap: surface, bumpScale: 2.5 });
  const fish = new Mesh(sheet(96, 72, body), skin);
  const fins = new Mesh(trim(), new MeshStandardMaterial({ vertexColors: true, roughness: 0.45, side: DoubleSide }));
  const root = new Group().add(fish, fins);
  fish.name = "skin";
  fins.name = "fins";
  const times = Array.from({ length: 97 }, (_, k) => k / 16);
  const influences = times.flatMap((time) => {
    const phase = (2 * Math.PI * time) / 6;
    return [smooth(0, 1, 0.5 - 0.62 * Math.cos(phase)), Math.sin(4 * phase)];
  });
  const tracks = [fish, fins].map(({ name }) =>
    new NumberKeyframeTrack(`${name}.morphTargetInfluences`, times, influences));
  const direction = [0.225, 0.118, 0.63];
  early(root, direction);
  const redirected = await redirect(fish, {
    rigidity, size: SIZE, grid: CELLS, mapSize: CELLS, worker: new Worker("worker.js", { type: "module" }),
    wasm: new URL("vrtm_bg.wasm", location.href).href,
  });
  const near = ([s, t]: number[]) => {
    const away = ({ uv }: Ring) => Math.hypot(uv[1] - s, uv[0] - t);
    return scales.reduce((best, ring) => (away(ring) < away(best) ? ring : best));
  };
  const open: Scene = {
    name: "Puffer fish", root, clips: [new AnimationClip("breathes in", 6, tracks)], notes: [],
    parts: [{
      meshes: [fish], source: redirected.source, redirected, rigidity, size: SIZE,
      texture: new ImageData(colour as Uint8ClampedArray<ArrayBuffer>, SIZE, SIZE),
    }],
    sentence: "A fish breathes in: its scales and eyes stretch with the skin; with vrtm they keep their shape.",
    direction,
    rings: [[0.46, 0.33], [0.6, 0.22], [0.34, 0.2]].map(near),
  };
  play(open, open.clips[0]);
  return open;
}

/** A scene of this page's files: its picture, and what of it is rigid. */
async function files(name: string, says: Omit<Scene, keyof Own>): Promise<Scene> {
  const [model, image] = await Promise.all(["glb", "png"].map(async (type) => {
    const response = await fetch(`scenes/${name}.${type}`);
    if (!response.ok) {
      throw new Error(`This page lacks its file scenes/${name}.${type}.`);
    }
    return response.blob();
  }));
  const open = await openFiles([{ path: `${name}.glb`, file: new File([model], `${name}.glb`) }]);
  const [part] = open.parts;
  const { size } = part;
  const context = new OffscreenCanvas(size, size).getContext("2d", { willReadFrequently: true })!;
  context.drawImage(await createImageBitmap(image, { colorSpaceConversion: "none" }), 0, 0, size, size);
  part.rigidity.set(context.getImageData(0, 0, size, size).data.filter((_, k) => k % 4 === 0));
  await part.redirected.setRigidity(part.rigidity, size);
  await part.redirected.asset.setSettings(0, { grid: CELLS });
  return { ...open, ...says };
}

/** A character that is open, with what the page says of it. */
export interface Scene extends Own {
  sentence: string;
  /** Where the camera stands, as a share of its distance at first. */
  direction: number[];
  rings: Ring[];
}

/** Gets what can be seen before its parts are ready. */
type Early = (root: Object3D, direction: number[]) => void;

/** Built-in scenes: titles, and what opens them. */
export const SCENES: Record<string, [title: string, open: (early: Early) => Promise<Scene>]> = {
  puffer: ["Puffer fish", puffer],
  creature: ["Lizard", () => files("creature", {
    sentence: "A lizard turns and breathes: with vrtm its scales keep their shape.",
    direction: [0.5, 0.22, 0.47], rings: [],
  })],
  jug: ["Jug", () => files("jug", {
    sentence: "A mug becomes a jug: with vrtm its gilded emblems keep their shape.",
    direction: [0.4, 0.25, 0.88], rings: [],
  })],
};
