/** Where rings of the size at rest lie on the surface in a pose. */
import { Vector3 } from "three";
import { shared } from "./looks.js";
import type { Ring } from "./scenes.js";
import type { Part } from "./state.js";

/** The place of a UV of a mesh on the surface in a pose. */
function placeOf({ mesh }: Part["source"], [u, v]: number[], pose: Float32Array): Vector3 | null {
  const { uvs, uvIndices, indices } = mesh;
  for (let k = 0; k < uvIndices.length; k += 3) {
    const [a, b, c] = [0, 1, 2].map((corner) => 2 * uvIndices[k + corner]);
    const [bx, by, cx, cy] = [uvs[b] - uvs[a], uvs[b + 1] - uvs[a + 1], uvs[c] - uvs[a], uvs[c + 1] - uvs[a + 1]];
    const [x, y, area] = [u - uvs[a], v - uvs[a + 1], bx * cy - by * cx];
    const [s, t] = [(x * cy - y * cx) / area, (bx * y - by * x) / area];
    if (s >= 0 && t >= 0 && s + t <= 1) {
      const corner = (n: number) => new Vector3().fromArray(pose, 3 * indices[k + n]);
      return corner(0).multiplyScalar(1 - s - t).addScaledVector(corner(1), s).addScaledVector(corner(2), t);
    }
  }
  return null;
}

/** Puts rings around paint, by the mesh's own UVs and redirected, for the pose of the last map. */
export function ring({ source, redirected }: Part, rings: Ring[], pose: Float32Array): void {
  const world = source.matrixWorld;
  for (const [k, { uv: [u, v], radius }] of rings.entries()) {
    // The place that has its paint from there.
    const at = { x: u, y: v };
    for (let step = 0; step < 16; step++) {
      // Half steps: the redirection may have a slope of more than 2.
      const { x, y } = redirected.uvAt(at);
      at.x += 0.5 * (u - x);
      at.y += 0.5 * (v - y);
    }
    [{ x: u, y: v }, at].forEach(({ x, y }, side) => {
      const place = placeOf(source, [x, 1 - y], pose)?.applyMatrix4(world);
      const { x: cx, y: cy, z: cz } = place ?? new Vector3();
      shared.rings.value[k + 3 * side].set(cx, cy, cz, place ? radius * world.getMaxScaleOnAxis() : 0);
    });
  }
}
