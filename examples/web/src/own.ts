/** The visitor's own character, from a glTF file. */
import {
  AnimationClip, AnimationMixer, CanvasTexture, NumberKeyframeTrack, RepeatWrapping, SRGBColorSpace, type Material,
  type Mesh, type MeshStandardMaterial, type Object3D, type SkinnedMesh, type Texture,
} from "three";
import { redirect } from "vrtm/three";
import { count, limits, list, load, tooLarge, type Named } from "./files.js";
import { layers } from "./layers.js";
import type { Open, Part } from "./state.js";

export interface Own extends Open {
  clips: AnimationClip[];
  /** Sentences on what of the file is not there or not redirected, and on the sizes that this device gets. */
  notes: string[];
}

interface Settings {
  /** Gets what can be seen before its parts are ready. */
  early?: (root: Object3D) => void;
  /** What is rigid, of so many texels along each side: by default nothing. */
  rigidity?: (size: number) => Uint8Array;
  /** Cells and texels of grids and maps along each side, at most. */
  cells?: number;
}

const isMesh = (object: Object3D): object is Mesh => (object as Mesh).isMesh === true;

/** Opens a character. Errors are sentences for the visitor. What was open before is closed by `dispose`, after this. */
export async function openFiles(files: Named[], settings: Settings = {}): Promise<Own> {
  const main = files.find(({ path }) => /\.(glb|gltf|vrm)$/i.test(path));
  if (!main) {
    const names = list(files.map(({ file }) => file.name)) || "This";
    throw new Error(`${names} is no glTF: a file that ends in .glb or .gltf is needed.`);
  }
  const { early, rigidity: rigid = (size) => new Uint8Array(size ** 2), cells = Infinity } = settings;
  const { bytes, texels, parts: most, size, ...sides } = limits();
  const [map, grid] = [sides.map, sides.grid].map((side) => Math.min(side, cells));
  const sum = files.reduce((sum, { file }) => sum + file.size, 0);
  if (sum > bytes) {
    throw tooLarge(main.file.name, Math.ceil(sum / 1e6), bytes / 1e6, "MB");
  }
  const notes: string[] = [];
  const { scene: root, animations: clips } = await load(main, files, notes);
  const open: Own = { name: main.file.name, root, parts: [], clips, notes };
  try {
    const groups = group(root, notes);
    const all = images(root).reduce((sum, { width, height }) => sum + width * height, 0);
    if (all > texels) {
      throw tooLarge(main.file.name, Math.ceil(all / 1e6), Math.floor(texels / 1e6), "million texels");
    }
    if (groups.length > most) {
      const [rest, all] = [groups.length - most, groups.length];
      notes.push(`${rest} of its ${all} parts are drawn as they are: this device redirects ${most}.`);
    }
    early?.(root);
    const sizes = groups.map(({ map: { image } }) => {
      const { width, height } = image as ImageBitmap;
      return Math.min(size, Math.max(256, 2 ** Math.round(Math.log2(Math.max(width, height)))));
    });
    const made = groups.slice(0, most).map(async ({ meshes, map: texture }, k): Promise<Part> => {
      const rigidity = rigid(sizes[k]);
      const redirected = await redirect(meshes, {
        rigidity, size: sizes[k], mapSize: Math.min(map, sizes[k]), grid, uv: texture.channel,
        worker: new Worker("worker.js", { type: "module" }), wasm: new URL("vrtm_bg.wasm", location.href).href,
        log: ({ code, values: [share] }) => {
          if (code === "Overlap" && share > 0.05 && open.parts.length === 0) {
            notes.push(`${Math.round(100 * share)} % of a texture are used more than twice: there it stays as it is.`);
          }
        },
      });
      if (!redirected.source.pose().every(Number.isFinite)) {
        redirected.dispose();
        throw new Error("its skin names bones that it does not have");
      }
      await redirected.update("draft");
      const { source } = redirected;
      return { meshes, source, redirected, rigidity, size: sizes[k], texture: unwrapped(texture, sizes[k]) };
    });
    for (const { status, ...result } of await Promise.allSettled(made)) {
      if (status === "fulfilled") {
        open.parts.push((result as { value: Part }).value);
      } else {
        notes.push(`One part is drawn as it is: ${(result as { reason: Error }).reason.message}.`);
      }
    }
    if (open.parts.length === 0) {
      throw new Error(notes.at(-1));
    }
    const [clip] = [...clips.filter(moves), ...inTurn(root, notes)];
    const deforms = groups.some(({ meshes }) =>
      meshes.some((mesh) => (mesh as SkinnedMesh).isSkinnedMesh || mesh.morphTargetInfluences));
    if (clip) {
      play(open, clip);
    }
    if (!clip || !deforms) {
      notes.push(clip
        ? "Its meshes move as wholes: nothing deforms, so nothing has to be redirected."
        : "It has no animation and no morph targets: it does not move, and nothing has to be redirected.");
    }
    notes.push(`For this device: maps of ${map} × ${map} texels, grids of ${grid} × ${grid} cells.`);
    return open;
  } catch (error) {
    dispose(open);
    throw error;
  }
}

/** Plays one of a character's clips, from its start. */
export function play(open: Own, clip: AnimationClip): void {
  open.clip?.mixer.stopAllAction();
  const mixer = open.clip?.mixer ?? new AnimationMixer(open.root);
  mixer.clipAction(clip).reset().play();
  mixer.setTime(0);
  open.clip = { mixer, duration: clip.duration, name: clip.name };
}

/** Ends workers, and frees what the GPU has of a character. */
export function dispose({ root, clip, parts }: Open): void {
  clip?.mixer.stopAllAction();
  clip?.mixer.uncacheRoot(root);
  parts.forEach(({ redirected }) => redirected.dispose());
  root.removeFromParent();
  root.traverse((object) => {
    const { geometry, skeleton } = object as SkinnedMesh;
    geometry?.dispose();
    skeleton?.dispose();
    materials(object).forEach((material) => {
      textures(material).forEach((texture) => texture.dispose());
      material.dispose();
    });
  });
  images(root).forEach((image) => image.close?.());
}

/** What is open in bytes: per node and triangle of the solver, per texel of maps and textures. */
export async function memory(parts: Part[]): Promise<string> {
  const grids = await Promise.all(parts.map(({ redirected }) => redirected.asset.grid(0)));
  const bytes = parts.reduce((sum, { source: { mesh }, size, redirected: { mapSize } }, k) =>
    sum + 157 * grids[k][0] * grids[k][1] + 116 * (mesh.indices.length / 3) + 8 * mapSize ** 2 + 22 * size ** 2, 0);
  const cells = grids.map((grid) => grid.join(" × ")).join(", ");
  return `Solved on ${cells} cells; this takes about ${Math.ceil(bytes / 1e6)} MB.`;
}

const materials = (object: Object3D): Material[] => [(object as Mesh).material ?? []].flat();
const textures = (material: Material): Texture[] => Object.values(material).filter((value) => value?.isTexture);

function images(root: Object3D): ImageBitmap[] {
  const all = new Set<ImageBitmap>();
  const add = ({ image }: Texture) => image && all.add(image as ImageBitmap);
  root.traverse((object) => materials(object).flatMap(textures).forEach(add));
  return [...all];
}

interface Group {
  meshes: Mesh[];
  map: Texture;
}

/** Meshes that share a texture and a skin, those with the most triangles first; others are drawn as they are. */
function group(root: Object3D, notes: string[]): Group[] {
  const all: Mesh[] = [];
  root?.traverse((object) => isMesh(object) && all.push(object));
  all.forEach(mend);
  if (all.length === 0) {
    throw new Error("It has no mesh: points, lines, cameras and lights have no surface to paint on.");
  }
  const mapOf = ({ material }: Mesh): Texture | undefined => {
    const [{ map, normalMap, emissiveMap, roughnessMap }] = [material].flat() as Partial<MeshStandardMaterial>[];
    return map ?? normalMap ?? emissiveMap ?? roughnessMap ?? undefined;
  };
  if (!all.some(mapOf)) {
    notes.push("It has no textures: it is shown with a pattern.");
    const map = pattern();
    all.flatMap(materials).forEach((material) => Object.assign(material, { map, needsUpdate: true }));
  }
  const groups = new Map<string, Group>();
  const bare: Mesh[] = [];
  for (const mesh of all) {
    const map = mapOf(mesh);
    if (map && hasArea(mesh, map.channel)) {
      // Characters that share textures move apart, and have maps of their own.
      const bones = (mesh as SkinnedMesh).skeleton?.bones.map(({ id }) => id) ?? [];
      const key = [map.source.uuid, map.channel, ...bones].join();
      groups.set(key, { map, meshes: [...(groups.get(key)?.meshes ?? []), mesh] });
    } else if (map) {
      bare.push(mesh);
    }
  }
  if (groups.size === 0) {
    throw new Error("It has no UVs, or all of them are in one place: unwrap it, and export it again.");
  }
  if (bare.length > 0) {
    notes.push(`${bare.length} of its ${all.length} meshes have no UVs: they are drawn as they are.`);
  }
  const corners = ({ geometry: { index, attributes } }: Mesh) => (index ?? attributes.position).count;
  const triangles = ({ meshes }: Group) => meshes.reduce((sum, mesh) => sum + corners(mesh), 0);
  const apart = [...groups.values()].flatMap(({ meshes, map }) =>
    layers(meshes, map.channel).map((meshes) => ({ meshes, map })));
  // A material looks up one map.
  const owners = new Map<Material, Group>();
  for (const group of apart) {
    for (const mesh of group.meshes) {
      const own = materials(mesh).map((material) =>
        ((owners.get(material) ?? group) === group ? material : material.clone()));
      own.forEach((material) => owners.set(material, group));
      mesh.material = Array.isArray(mesh.material) ? own : own[0];
    }
  }
  return apart.sort((a, b) => triangles(b) - triangles(a));
}

/** Some exporters write skin weights that are no numbers: such vertices follow their first bone. */
function mend({ geometry: { attributes: { skinWeight } } }: Mesh): void {
  for (let k = 0; k < (skinWeight?.count ?? 0); k++) {
    if (!Number.isFinite(skinWeight.getX(k) + skinWeight.getY(k) + skinWeight.getZ(k) + skinWeight.getW(k))) {
      skinWeight.setXYZW(k, 1, 0, 0, 0);
    }
  }
}

/** The UVs of a mesh are there, and not all on one line. */
function hasArea({ geometry: { attributes, index } }: Mesh, channel: number): boolean {
  const uv = attributes[channel === 0 ? "uv" : `uv${channel}`];
  const corners = (index ?? attributes.position).count;
  for (let k = 0; uv && k + 2 < corners; k += 3) {
    const [a, b, c] = [k, k + 1, k + 2].map((corner) => (index ? index.getX(corner) : corner));
    const [u, v] = [uv.getX(a), uv.getY(a)];
    const area = (uv.getX(b) - u) * (uv.getY(c) - v) - (uv.getX(c) - u) * (uv.getY(b) - v);
    if (Math.abs(area) > 1e-12) {
      return true;
    }
  }
  return false;
}

/** Discs on a light ground, for what has no texture. */
function pattern(): Texture {
  const context = new OffscreenCanvas(512, 512).getContext("2d")!;
  context.fillStyle = "#e1e1e1";
  context.fillRect(0, 0, 512, 512);
  context.fillStyle = "#285a78";
  for (let k = 0; k < 256; k++) {
    context.beginPath();
    context.arc(32 * (k % 16) + 16, 32 * Math.floor(k / 16) + 16, 9, 0, 7);
    context.fill();
  }
  const texture = new CanvasTexture(context.canvas);
  texture.wrapS = texture.wrapT = RepeatWrapping;
  texture.colorSpace = SRGBColorSpace;
  texture.flipY = false;
  return texture;
}

/** A texture as the mesh's own UVs see it, before the texture's transform; the first row is v = 1 of vrtm. */
function unwrapped(texture: Texture, size: number): ImageData | null {
  const image = texture.image as ImageBitmap;
  const canvas = new OffscreenCanvas(size, size);
  const context = canvas.getContext("2d", { willReadFrequently: true })!;
  const tile = context.createPattern(image, "repeat")!;
  texture.updateMatrix();
  const [a, b, , c, d, , e, f] = texture.matrix.elements;
  tile.setTransform(new DOMMatrix([a, b, c, d, e, f]).inverse().scale(1 / image.width, 1 / image.height));
  context.scale(size, size);
  context.fillStyle = tile;
  context.fillRect(0, 0, 1, 1);
  return context.getImageData(0, 0, size, size);
}

const moves = ({ tracks }: AnimationClip): boolean =>
  tracks.some((track) => track.values.some((x, k) => Math.abs(x - track.values[k % track.getValueSize()]) > 1e-4));

/** A clip of all morph targets, one after the other, for a file that has none. */
function inTurn(root: Object3D, notes: string[]): AnimationClip[] {
  const meshes: Mesh[] = [];
  root.traverse((object) => isMesh(object) && object.morphTargetDictionary && meshes.push(object));
  const names = [...new Set(meshes.flatMap(({ morphTargetDictionary }) => Object.keys(morphTargetDictionary!)))];
  const tracks = meshes.flatMap(({ uuid, morphTargetDictionary }) =>
    Object.entries(morphTargetDictionary!).map(([name, k]) => {
      const start = names.indexOf(name);
      return new NumberKeyframeTrack(`${uuid}.morphTargetInfluences[${k}]`, [start, start + 0.5, start + 1], [0, 1, 0]);
    }));
  return names.length > 0 ? [new AnimationClip("morph targets in turn", names.length, tracks)] : [];
}
