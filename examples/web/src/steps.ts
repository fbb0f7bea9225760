/** What was painted, to be taken back and done again: rectangles of texels. */
import type { Part } from "./state.js";

/** First column and row, columns and rows. */
export type Rect = [number, number, number, number];

/** A rectangle of a part's map, and its texels before or after. */
export interface Change {
  part: Part;
  rect: Rect;
  texels: Uint8Array;
}

/** Bytes that are kept at most; one step is kept in any case. */
const MOST = 32e6;

export function around(one: Rect | undefined, other: Rect): Rect {
  const [x, y, columns, rows] = one ?? other;
  const first = [Math.min(x, other[0]), Math.min(y, other[1])];
  const end = [Math.max(x + columns, other[0] + other[2]), Math.max(y + rows, other[1] + other[3])];
  return [first[0], first[1], end[0] - first[0], end[1] - first[1]];
}

/** The texels of a rectangle. */
export function copy(map: Uint8Array, size: number, [x, y, columns, rows]: Rect): Uint8Array {
  const texels = new Uint8Array(columns * rows);
  for (let row = 0; row < rows; row++) {
    const first = (y + row) * size + x;
    texels.set(map.subarray(first, first + columns), row * columns);
  }
  return texels;
}

/** Makes a change; returns what takes it back. */
function made({ part, rect, texels }: Change): Change {
  const before = copy(part.rigidity, part.size, rect);
  const [x, y, columns, rows] = rect;
  for (let row = 0; row < rows; row++) {
    part.rigidity.set(texels.subarray(row * columns, (row + 1) * columns), (y + row) * part.size + x);
  }
  return { part, rect, texels: before };
}

export class Steps {
  undone: Change[][] = [];
  done: Change[][] = [];

  /** Keeps what was there before a new step. */
  keep(before: Change[]): void {
    if (before.length > 0) {
      this.done.push(before);
      this.undone = [];
      const bytes = () => this.done.flat().reduce((sum, { texels }) => sum + texels.length, 0);
      while (this.done.length > 1 && bytes() > MOST) {
        this.done.shift();
      }
    }
  }

  /** Takes the newest step back, or does again what was taken back last; returns what changed. */
  move(from: "done" | "undone"): Change[] {
    const step = this[from].pop() ?? [];
    if (step.length > 0) {
      this[from === "done" ? "undone" : "done"].push(step.map(made));
    }
    return step;
  }
}
