/** Triangles of meshes of three.js with their UVs, in the tile that vrtm has a map of. */
import type { BufferAttribute, InterleavedBufferAttribute, Mesh } from "three";

/** An attribute as plain numbers, without a copy where it is that already. */
export function numbers(attribute: BufferAttribute | InterleavedBufferAttribute, size: number): Float32Array {
  const { array, count, itemSize, normalized } = attribute;
  if (array instanceof Float32Array && itemSize === size && !normalized && !("data" in attribute)) {
    return array;
  }
  return Float32Array.from({ length: size * count }, (_, k) => attribute.getComponent(Math.floor(k / size), k % size));
}

/** Charts outside of the first tile that repeat it are moved there. */
export function layout(meshes: Mesh[], vertexOf: Uint32Array[], uv: number, flipY: boolean) {
  const indices: number[] = [];
  const uvIndices: number[] = [];
  const uvs: number[] = [];
  const name = uv === 0 ? "uv" : `uv${uv}`;
  // UVs of each welded vertex.
  const numbersOf: number[][] = [];
  meshes.forEach((mesh, p) => {
    const { index, attributes } = mesh.geometry;
    if (!attributes[name]) {
      throw new Error(`mesh "${mesh.name}" has no UVs (${name})`);
    }
    const own = numbers(attributes[name], 2);
    const number = Uint32Array.from(vertexOf[p], (n, v) => {
      const [x, y] = [own[2 * v], flipY ? own[2 * v + 1] : 1 - own[2 * v + 1]];
      const all = (numbersOf[n] ??= []);
      const same = all.find((number) => uvs[2 * number] === x && uvs[2 * number + 1] === y);
      if (same === undefined) {
        all.push(uvs.length / 2);
        uvs.push(x, y);
      }
      return same ?? all[all.length - 1];
    });
    const corners = index ? index.count : vertexOf[p].length;
    for (let k = 0; k + 2 < corners; k += 3) {
      const triangle = [k, k + 1, k + 2].map((corner) => (index ? index.getX(corner) : corner));
      const [a, b, c] = triangle.map((v) => vertexOf[p][v]);
      // Triangles without area, which join strips.
      if (a !== b && b !== c && c !== a) {
        indices.push(a, b, c);
        uvIndices.push(...triangle.map((v) => number[v]));
      }
    }
  });
  const faceCounts = new Uint32Array(indices.length / 3).fill(3);
  return { faceCounts, indices: Uint32Array.from(indices), ...toFirstTile(uvs, uvIndices) };
}

/** Moves charts by whole tiles to the first one. Triangles of a chart that repeats its texture are moved one by one:
 * texels that several of them use stay where they are. */
function toFirstTile(given: number[], corners: number[]) {
  const parent = Array.from({ length: given.length / 2 }, (_, k) => k);
  const root = (k: number) => {
    while (parent[k] !== k) {
      k = parent[k] = parent[parent[k]];
    }
    return k;
  };
  for (let k = 0; k < corners.length; k++) {
    parent[root(corners[k])] = root(corners[k - (k % 3)]);
  }
  const bounds = parent.map(() => [Infinity, -Infinity, Infinity, -Infinity]);
  given.forEach((x, k) => {
    const box = bounds[root(k >> 1)];
    const side = 2 * (k % 2);
    box[side] = Math.min(box[side], x);
    box[side + 1] = Math.max(box[side + 1], x);
  });
  const uvs = Float32Array.from(given);
  const moved: number[] = [];
  const uvIndices = Uint32Array.from(corners);
  for (let k = 0; k < corners.length; k += 3) {
    const box = bounds[root(corners[k])];
    const shifts = [0, 1].map((axis) => Math.floor((box[2 * axis] + box[2 * axis + 1]) / 2));
    // Painters leave a little bleed.
    const fits = shifts.every((shift, axis) => box[2 * axis] - shift > -0.05 && box[2 * axis + 1] - shift < 1.05);
    const triangle = corners.slice(k, k + 3);
    const middle = [0, 1].map((axis) => Math.floor(triangle.reduce((sum, n) => sum + given[2 * n + axis], 0) / 3));
    triangle.forEach((number, corner) => {
      const at = shifts.map((shift, axis) => given[2 * number + axis] - (fits ? shift : middle[axis]));
      if (fits) {
        uvs.set(at, 2 * number);
      } else {
        moved.push(...at);
        uvIndices[k + corner] = (given.length + moved.length) / 2 - 1;
      }
    });
  }
  const all = new Float32Array(uvs.length + moved.length);
  all.set(uvs);
  all.set(moved, uvs.length);
  return { uvs: all, uvIndices };
}
