/** What measured strain says in words, and the frame in which most of it is left. */
import type { Report, Strain } from "vrtm";
import type { Part } from "./state.js";

/** Root mean squares of the strain of what is painted, without vrtm and with it. */
export interface Measure {
  before: number;
  after: number;
}

/** The parts' strain, each by the area of what is rigid; `null` before it is measured. */
export function measured(parts: Part[]): Measure | null {
  const known = parts.filter(({ redirected: { report } }) => report?.strain);
  const weights = known.map(({ rigidity, size }) => rigidity.reduce((sum, x) => sum + x, 0) / (size * size));
  const sum = weights.reduce((a, b) => a + b, 0);
  const mean = (of: (report: Report) => Strain) =>
    Math.sqrt(known.reduce((all, { redirected }, k) => all + weights[k] * of(redirected.report!).rms ** 2, 0) / sum);
  return sum > 0 ? { before: mean(({ strain }) => strain!.before), after: mean(({ strain }) => strain!.after) } : null;
}

const percent = (share: number) => `${(100 * share).toFixed(share < 0.0995 ? 1 : 0)} %`;

const words = ({ before, after }: Measure) =>
  before < 0.005
    ? "Nothing that is painted is stretched on this frame."
    : `Painted features were stretched by ${percent(before)} on average, now by ${percent(after)}.`;

/** Tells what is stretched; `null` where nothing is painted. */
export function tell(strain: Measure | null): void {
  for (const [name, share] of [["without", strain?.before], ["with", strain?.after]] as const) {
    document.querySelector(`.${name} b`)!.textContent = share === undefined ? "" : `${percent(share)} stretched`;
  }
  const numbers = document.getElementById("numbers")!;
  numbers.textContent = strain ? words(strain) : "Nothing is painted that keeps its shape.";
}

/** The measures of a loop's frames, by their time. */
export class Loop {
  #frames = new Map<number, Measure>();

  add(time: number, measure: Measure): void {
    this.#frames.set(Math.round(10 * time) / 10, measure);
  }

  /** The time at which most is left; `null` before the loop was seen. */
  worst(): number | null {
    const [first] = [...this.#frames].sort(([, a], [, b]) => b.after - a.after);
    return first?.[0] ?? null;
  }
}
