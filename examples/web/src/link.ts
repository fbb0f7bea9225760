/** A link that keeps what is seen of a built-in scene: its frame, view, look and paint, in the part after `#`. */
import { deflateSync, inflateSync } from "three/addons/libs/fflate.module.js";

export interface Kept {
  scene: string;
  time: number;
  /** Camera: its place minus what it looks at, as multiples of the distance at first. */
  view: number[];
  look: string;
  compare: string;
  wipe: number;
  lines: boolean;
  /** What was painted over: `strokes`. */
  paint: string;
}

/** Cells of paint along each side, and most characters. */
const CELLS = 256;
const MOST = 16_000;

/** Paint where it differs from what was there: cells with 16 levels of rigidity, 0 = as it was. */
export function strokes(now: Uint8Array, first: Uint8Array, size: number): string {
  const levels = Uint8Array.from({ length: CELLS * CELLS }, (_, cell) => {
    const at = middle(cell, size);
    return Math.abs(now[at] - first[at]) > 8 ? 1 + Math.round(now[at] / 17) : 0;
  });
  if (levels.every((level) => level === 0)) {
    return "";
  }
  const bytes = deflateSync(levels, { level: 9 });
  const text = btoa(String.fromCharCode(...bytes)).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
  if (text.length > MOST) {
    throw new Error("There is too much new paint for a link: save the rigidity as an image instead.");
  }
  return text;
}

/** Paints them, and ignores what is no such text. */
export function restroke(text: string, first: Uint8Array, size: number): Uint8Array {
  const to = first.slice();
  const levels = new Uint8Array(CELLS * CELLS);
  try {
    const bytes = Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (c) => c.charCodeAt(0));
    inflateSync(bytes, { out: levels });
  } catch {
    return to;
  }
  const side = size / CELLS;
  levels.forEach((level, cell) => {
    const [x, y] = [Math.ceil((cell % CELLS) * side), Math.ceil(Math.floor(cell / CELLS) * side)];
    for (let row = y; level > 0 && row < y + side; row++) {
      to.fill(17 * Math.min(level - 1, 15), row * size + x, row * size + Math.ceil(x + side));
    }
  });
  return to;
}

function middle(cell: number, size: number): number {
  const [x, y] = [cell % CELLS, Math.floor(cell / CELLS)].map((at) => Math.floor(((at + 0.5) * size) / CELLS));
  return y * size + x;
}

export function write({ view, time, wipe, lines, ...words }: Kept): string {
  const three = (x: number) => x.toFixed(3);
  const numbers = { time: three(time), view: view.map(three).join(), wipe: three(wipe), lines: lines ? "1" : "" };
  const filled = Object.entries({ ...words, ...numbers }).filter(([, value]) => value !== "");
  return new URLSearchParams(filled).toString().replaceAll("%2C", ",");
}

export function read(hash: string): Partial<Kept> {
  const given = new URLSearchParams(hash.replace(/^#/, ""));
  const word = (name: string) => given.get(name) ?? undefined;
  const number = (name: string) => {
    const value = Number(given.get(name) ?? NaN);
    return Number.isFinite(value) ? value : undefined;
  };
  const view = given.get("view")?.split(",").map(Number);
  return {
    scene: word("scene"), look: word("look"), compare: word("compare"), paint: word("paint"),
    lines: given.has("lines"), time: number("time"), wipe: number("wipe"),
    view: view?.length === 3 && view.every(Number.isFinite) ? view : undefined,
  };
}
