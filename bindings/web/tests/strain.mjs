// Strain of what is rigid, from a redirection map and two poses, by arithmetic that nothing of vrtm is used for.

/** Those of all parts of what is open in a page. */
export const strains = (page) => page.evaluate(`(${ofParts})(${strainOf})`);
const ofParts = (strainOf) => character.parts.map(({ source, redirected: { delta, mapSize }, rigidity, size }) =>
  strainOf({ ...source.mesh, rest: source.rest(), pose: source.pose(), delta, map: mapSize, rigidity, size }));

/** Root mean squares over pairs of neighbouring places of a surface, by the area of paint that they have. */
function strainOf({ rest, pose, uvs, indices, uvIndices, delta, map, rigidity, size }) {
  const N = 700;
  const triangles = new Int32Array(N * N).fill(-1);
  const corners = (k) => [0, 1, 2].map((n) => [uvs[2 * uvIndices[k + n]], uvs[2 * uvIndices[k + n] + 1]]);
  /** Weights of the corners of a triangle at a UV. */
  const weights = (k, [u, v]) => {
    const [[ax, ay], [bx, by], [cx, cy]] = corners(k);
    const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
    const s = ((u - ax) * (cy - ay) - (v - ay) * (cx - ax)) / area;
    const t = ((bx - ax) * (v - ay) - (by - ay) * (u - ax)) / area;
    return [1 - s - t, s, t];
  };
  const place = (i, j) => [(i + 0.5) / N, (j + 0.5) / N];
  for (let k = 0; k < uvIndices.length; k += 3) {
    const at = corners(k);
    const [low, high] = [Math.min, Math.max].map((of) => [0, 1].map((axis) => of(...at.map((uv) => uv[axis]))));
    for (let j = Math.floor(low[1] * N); j <= high[1] * N; j++) {
      for (let i = Math.floor(low[0] * N); i <= high[0] * N; i++) {
        if (weights(k, place(i, j)).every((w) => w >= -1e-9)) {
          triangles[j * N + i] = k;
        }
      }
    }
  }
  const triangleAt = ([u, v]) => triangles[Math.floor(v * N) * N + Math.floor(u * N)] ?? -1;
  const point = (positions, uv) => {
    const k = triangleAt(uv);
    const of = weights(k, uv);
    return [0, 1, 2].map((axis) => of.reduce((sum, w, n) => sum + w * positions[3 * indices[k + n] + axis], 0));
  };
  const shift = new Float16Array(delta.buffer, delta.byteOffset, delta.length);
  const painted = ([u, v]) => {
    const [x, y] = [u * map - 0.5, (1 - v) * map - 0.5];
    const [i, j] = [Math.floor(x), Math.floor(y)];
    return [u, v].map((own, c) => {
      const at = (i, j) => shift[2 * (j * map + i) + c];
      const row = (j) => at(i, j) * (i + 1 - x) + at(i + 1, j) * (x - i);
      return own + row(j) * (j + 1 - y) + row(j + 1) * (y - j);
    });
  };
  const rigid = ([u, v]) => rigidity[Math.floor((1 - v) * size) * size + Math.floor(u * size)] / 255;
  const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);

  return Object.fromEntries([["before", (uv) => uv], ["after", painted]].map(([name, paint]) => {
    let [sum, total] = [0, 0];
    for (let j = 8; j < N - 8; j += 2) {
      for (let i = 8; i < N - 8; i += 2) {
        const from = place(i, j);
        // So long that the rounding of half floats is small.
        for (const to of [place(i + 4, j), place(i, j + 4), place(i + 3, j + 3), place(i + 3, j - 3)]) {
          const [p, q] = [paint(from), paint(to)];
          if ([from, to, p, q].some((uv) => triangleAt(uv) < 0)) {
            continue;
          }
          const middle = [(p[0] + q[0]) / 2, (p[1] + q[1]) / 2];
          const weight = Math.min(...[p, middle, q].map(rigid)) > 0.5 ? Math.hypot(p[0] - q[0], p[1] - q[1]) ** 2 : 0;
          if (weight > 0) {
            const now = distance(point(pose, from), point(pose, to));
            sum += weight * (now / distance(point(rest, p), point(rest, q)) - 1) ** 2;
            total += weight;
          }
        }
      }
    }
    return [name, Math.sqrt(sum / total)];
  }));
}
