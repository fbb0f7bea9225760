/** A link that keeps what is seen of a built-in scene: its frame, view, look and paint, in the part after `#`. */
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

/** Paint where it differs from what was there: runs of cells with 16 levels of rigidity, 0 = as it was. */
export function strokes(now: Uint8Array, first: Uint8Array, size: number): string {
  const bytes: number[] = [];
  let [run, last] = [0, 0];
  const put = () => {
    for (let left = run; left > 0; left -= 2048) {
      const length = Math.min(left, 2048) - 1;
      bytes.push((last << 3) | (length & 7), length >> 3);
    }
  };
  for (let k = 0; k < CELLS * CELLS; k++) {
    const at = middle(k, size);
    const level = Math.abs(now[at] - first[at]) > 8 ? 1 + Math.round(now[at] / 17) : 0;
    if (level !== last) {
      put();
      [run, last] = [0, level];
    }
    run++;
  }
  if (last) {
    put();
  }
  // Levels are 0 to 16: five bits of the first byte; three more, and the second one, are the run's length.
  const text = btoa(String.fromCharCode(...bytes)).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
  if (text.length > MOST) {
    throw new Error("There is too much new paint for a link: save the rigidity as an image instead.");
  }
  return text;
}

/** Paints them, and ignores what is no such text. */
export function restroke(text: string, first: Uint8Array, size: number): Uint8Array {
  const to = first.slice();
  let bytes = "";
  try {
    bytes = atob(text.slice(0, MOST).replaceAll("-", "+").replaceAll("_", "/"));
  } catch {
    return to;
  }
  const side = size / CELLS;
  let cell = 0;
  for (let k = 0; k + 1 < bytes.length; k += 2) {
    const [level, length] = [bytes.charCodeAt(k) >> 3, (bytes.charCodeAt(k) & 7) + 8 * bytes.charCodeAt(k + 1) + 1];
    for (const end = Math.min(cell + length, CELLS * CELLS); cell < end; cell++) {
      const [x, y] = [Math.ceil((cell % CELLS) * side), Math.ceil(Math.floor(cell / CELLS) * side)];
      for (let row = y; level > 0 && row < y + side; row++) {
        to.fill(17 * Math.min(level - 1, 15), row * size + x, row * size + Math.ceil(x + side));
      }
    }
  }
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
