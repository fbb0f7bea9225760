/** Files of the visitor's: they are read here and sent nowhere. */
import { LoadingManager } from "three";
import { DRACOLoader } from "three/addons/loaders/DRACOLoader.js";
import { GLTFLoader, type GLTF, type GLTFParser } from "three/addons/loaders/GLTFLoader.js";

/** A file and its place in the folder that was dropped. */
export interface Named {
  path: string;
  file: File;
}

/** What a device bears: bytes of files, vertices, texels of all textures, parts (each has a worker), texels
 * of a rigidity and a map along each side, and cells of the grid. */
const LIMITS = {
  desk: { bytes: 400e6, vertices: 500_000, texels: 2 ** 27, parts: 8, size: 1024, map: 512, grid: 512 },
  phone: { bytes: 100e6, vertices: 150_000, texels: 2 ** 25, parts: 3, size: 512, map: 256, grid: 256 },
};

/** Browsers that do not tell their memory are taken for a phone if they have a finger for a pointer. */
export function limits(): (typeof LIMITS)["desk"] {
  const { deviceMemory = matchMedia("(pointer: coarse)").matches ? 4 : 8 } = navigator as { deviceMemory?: number };
  return deviceMemory > 4 ? LIMITS.desk : LIMITS.phone;
}

/** Calls `chosen` with the files, or the folder, that are dropped on an element or chosen with an input. */
export function mount(target: HTMLElement, input: HTMLInputElement, chosen: (files: Promise<Named[]>) => void): void {
  input.addEventListener("change", () => {
    chosen(Promise.all([...(input.files ?? [])].map(walk)).then((files) => files.flat()));
    // The same file can be chosen again.
    input.value = "";
  });
  target.addEventListener("dragover", (event) => event.preventDefault());
  target.addEventListener("drop", (event) => {
    event.preventDefault();
    const items = [...(event.dataTransfer?.items ?? [])].filter(({ kind }) => kind === "file");
    const given = items.map((item) => item.webkitGetAsEntry() ?? item.getAsFile());
    chosen(Promise.all(given.map(walk)).then((files) => files.flat()));
  });
}

async function walk(entry: FileSystemEntry | File | null): Promise<Named[]> {
  if (!entry || entry instanceof File) {
    return entry ? [{ path: entry.name, file: entry }] : [];
  }
  if (entry.isFile) {
    const file = await new Promise<File>((resolve, reject) => (entry as FileSystemFileEntry).file(resolve, reject));
    return [{ path: entry.fullPath, file }];
  }
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  const all: Named[] = [];
  for (;;) {
    // A reader gives a hundred entries at a time.
    const some = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
    if (some.length === 0) {
      return all;
    }
    all.push(...(await Promise.all(some.map(walk))).flat());
  }
}

export const list = (names: Iterable<string>) => [...new Set(names)].join(", ");
export const tooLarge = (name: string, is: number, most: number, what: string) =>
  new Error(`${name} has ${count(is, what)}: this device opens up to ${count(most, what)}.`);
export const count = (n: number, what: string) => `${n.toLocaleString("en")} ${what}`;
/** Reads a glTF, with the files that it names. */
export async function load({ path, file }: Named, files: Named[], notes: string[]): Promise<GLTF> {
  const urls: string[] = [];
  const missing: string[] = [];
  let unread = 0;
  let parser: GLTFParser | undefined;
  const manager = new LoadingManager(undefined, undefined, () => unread++);
  const root = (path: string) => new URL(path.split("/").map(encodeURIComponent).join("/").replace(/^\/*/, "file:///"));
  manager.setURLModifier((url) => {
    if (/^(data|blob):/.test(url)) {
      return url;
    }
    const name = decodeURIComponent(url).replace(/^\.\//, "");
    const place = decodeURIComponent(new URL(url, root(path)).pathname);
    const base = place.split("/").at(-1);
    const found = files.find(({ path }) => decodeURIComponent(root(path).pathname) === place)
      ?? files.find(({ file }) => file.name === base);
    if (!found) {
      missing.push(name);
      return "data:,";
    }
    urls.push(URL.createObjectURL(found.file));
    return urls.at(-1)!;
  });
  // Its decoder is 0.06 MB by Brotli, which only such a file loads.
  const draco = new DRACOLoader().setDecoderPath("draco/");
  const check = async (): Promise<void> => {
    const { json, extensions, plugins, options } = parser!;
    const known: object = { ...extensions, ...plugins };
    const unknown = (json.extensionsRequired ?? []).filter((name: string) =>
      !(name in known) || name === "KHR_texture_basisu");
    if (unknown.length > 0) {
      throw new Error(`${file.name} needs ${list(unknown)}, which this page cannot read: export it without.`);
    }
    const meshes: { primitives: { attributes: { POSITION: number } }[] }[] = json.meshes ?? [];
    const primitives = meshes.flatMap(({ primitives }) => primitives);
    const vertices = new Set(primitives.map(({ attributes }) => attributes.POSITION));
    const total = [...vertices].reduce((sum, k) => sum + (json.accessors?.[k]?.count ?? 0), 0);
    if (total > limits().vertices) {
      throw tooLarge(file.name, total, limits().vertices, "vertices");
    }
    if (json.extensionsUsed?.some((name: string) => name.endsWith("_meshopt_compression"))) {
      // Its types are in a package of their own.
      const module: object = await import("three/addons/libs/meshopt_decoder.module.js");
      Object.assign(options, { meshoptDecoder: (module as Record<string, unknown>).MeshoptDecoder });
    }
  };
  const loader = new GLTFLoader(manager).setDRACOLoader(draco).register((made) => {
    parser = made;
    return { name: "check", beforeRoot: check };
  });
  try {
    const gltf = await loader.parseAsync(await file.arrayBuffer(), "");
    if (missing.length > 0) {
      notes.push(`Without ${list(missing)}: drop such files together with ${file.name}.`);
    }
    if (unread > missing.length) {
      notes.push(`${count(unread - missing.length, "of its textures cannot be read.")}`);
    }
    return gltf;
  } catch (error) {
    const { message } = error as Error;
    if (missing.length > 0) {
      throw new Error(`${file.name} needs ${list(missing)}: drop all its files together, or its folder.`);
    }
    throw message.startsWith(file.name) ? error : new Error(`${file.name} is broken, or not whole: ${message}`);
  } finally {
    urls.forEach((url) => URL.revokeObjectURL(url));
    draco.dispose();
  }
}
