/** What a page and its worker say to one another. */
import type { Kind, Mesh, Options, Report, Settings, Texels, Numbers, Tile } from "./index.js";

/** An image to fetch after a solve. */
export interface Fetch {
  tile: number;
  kind: Kind;
  width: number;
  height: number;
  /** Bits of half floats in the place of 32-bit floats. */
  half?: boolean;
}

/** The result of `redirect`: the images in the order of the fetches, and the report of each tile. */
export interface Redirected {
  images: (Float32Array | Uint16Array)[];
  reports: Report[];
}

export type Call =
  | { name: "create"; wasm?: string; mesh: Mesh }
  | { name: "setRigidity" | "setMask"; tile: number; values: Texels | null; width: number; height: number }
  | { name: "updateRigidity"; tile: number; values: Texels; width: number; height: number; part: number[] }
  | { name: "setSettings"; tile: number; settings: Settings }
  | { name: "redirect"; positions: Numbers; options: Options; fetches: Fetch[] }
  | { name: "cornerUvs"; uvSet: number };

export type Question = Call & { id: number };
export type Answer = { id: number; value: unknown } | { id: number; error: { name: string; message: string } };
export type Created = Tile[];
