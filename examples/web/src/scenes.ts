/** Built-in characters: files of this page, a glb and a picture of what is rigid. */
import type { Object3D } from "three";
import { openFiles, type Own } from "./own.js";

/** Circles of the surface at rest that rings mark. */
export interface Ring {
  uv: [number, number];
  radius: number;
}

/** What the page says of a character. */
interface Told {
  sentence: string;
  /** Where the camera stands, as a share of its distance at first. */
  direction: number[];
  rings: Ring[];
}
export type Scene = Own & Told;

export const SCENES: Record<string, Told & { name: string }> = {
  puffer: {
    name: "Puffer fish",
    sentence: "A fish breathes in: its scales and eyes stretch with the skin; with vrtm they keep their shape.",
    direction: [0.225, 0.118, 0.63],
    rings: [
      { uv: [0.31154, 0.44112], radius: 0.0591 },
      { uv: [0.22, 0.58284], radius: 0.0593 },
      { uv: [0.21417, 0.37355], radius: 0.0568 },
    ],
  },
  creature: {
    name: "Lizard",
    sentence: "A lizard turns and breathes: with vrtm its scales keep their shape.",
    direction: [0.5, 0.22, 0.47], rings: [],
  },
};
/** Cells of the grids and texels of the maps along each side, at most: scenes play smoothly with them. */
const CELLS = 384;

/** Opens a built-in character; `early` gets what can be seen before its parts are ready. */
export async function openScene(name: string, early: (root: Object3D) => void): Promise<Scene> {
  const [model, picture] = await Promise.all(["glb", "png"].map(async (type) => {
    const response = await fetch(`scenes/${name}.${type}`);
    if (!response.ok) {
      throw new Error(`This page lacks its file scenes/${name}.${type}.`);
    }
    return response.blob();
  }));
  const image = await createImageBitmap(picture, { colorSpaceConversion: "none" });
  const rigidity = (size: number) => {
    const context = new OffscreenCanvas(size, size).getContext("2d", { willReadFrequently: true })!;
    context.drawImage(image, 0, 0, size, size);
    return Uint8Array.from(context.getImageData(0, 0, size, size).data.filter((_, k) => k % 4 === 0));
  };
  const file = new File([model], `${name}.glb`);
  const open = await openFiles([{ path: file.name, file }], { early, rigidity, cells: CELLS });
  return { ...open, ...SCENES[name], notes: [] };
}
