/** The brush: the surface under a pointer, and the texels that are seen there. */
import { Vector3 } from "three";
import { Surface, type SurfaceHit } from "vrtm";
import type { Sight } from "./stage.js";
import type { Part } from "./state.js";
import { around, type Rect } from "./steps.js";

/** The place of a part that is seen. */
export interface Hit extends SurfaceHit {
  part: Part;
  redirected: boolean;
  world: Vector3;
  /** The size of a pixel there, in the world. */
  pixel: number;
}

/** A part's map in a stroke: dabs that overlap do not add up. */
export interface Touched {
  before: Uint8Array;
  cover: Float32Array;
  rect?: Rect;
}

const surfaces = new WeakMap<Part, { surface: Surface; delta?: Uint16Array; redirected?: boolean }>();

/** The surface of a part as it is seen, with or without its redirection. */
function surfaceOf(part: Part, redirected: boolean): Surface {
  const { source, redirected: { delta, mapSize } } = part;
  const found = surfaces.get(part) ?? { surface: new Surface(source.mesh) };
  surfaces.set(part, found);
  if (found.delta !== delta || found.redirected !== redirected) {
    found.surface.pose(source.pose(), redirected ? delta : new Uint16Array(delta.length), [mapSize, mapSize]);
    Object.assign(found, { delta, redirected });
  }
  return found.surface;
}

/** What a ray hits first. */
export function under({ ray, redirected, pixel }: Sight, parts: Part[]): Hit | undefined {
  let best: Hit | undefined;
  let nearest = Infinity;
  for (const part of parts) {
    const matrix = part.source.matrixWorld;
    const inverse = matrix.clone().invert();
    const from = ray.origin.clone().applyMatrix4(inverse);
    const way = ray.at(1, new Vector3()).applyMatrix4(inverse).sub(from);
    const hit = surfaceOf(part, redirected).hit(from.toArray(), way.toArray());
    const world = new Vector3(...(hit?.point ?? [])).applyMatrix4(matrix);
    const away = world.distanceTo(ray.origin);
    if (hit && away < nearest) {
      nearest = away;
      best = { ...hit, part, redirected, world, pixel: pixel * away };
    }
  }
  return best;
}

/** Paints around a hit, with a radius in pixels; returns what changed. */
export function dab(
  { part, redirected, pixel, ...hit }: Hit,
  touched: Map<Part, Touched>,
  radius: number,
  softness: number,
  target: number,
): Rect | undefined {
  const { rigidity: map, size } = part;
  const known: Touched = touched.get(part) ?? { before: map.slice(), cover: new Float32Array(map.length) };
  const { before, cover } = known;
  const own = (radius * pixel) / part.source.matrixWorld.getMaxScaleOnAxis();
  const found = surfaceOf(part, redirected).dab(hit, own, softness, [size, size]);
  let [left, top, right, bottom] = [size, size, -1, -1];
  found.texels.forEach((at, k) => {
    if (found.cover[k] > cover[at]) {
      cover[at] = found.cover[k];
      map[at] = Math.round(before[at] + (target - before[at]) * cover[at]);
      const [x, y] = [at % size, Math.floor(at / size)];
      [left, right, top, bottom] = [Math.min(left, x), Math.max(right, x), Math.min(top, y), Math.max(bottom, y)];
    }
  });
  if (right < left) {
    return undefined;
  }
  const rect: Rect = [left, top, right - left + 1, bottom - top + 1];
  touched.set(part, { before, cover, rect: around(known.rect, rect) });
  return rect;
}
