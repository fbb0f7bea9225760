/** Mirrored halves and twins have one place in the texture, but move apart: each needs a mesh with a map of its own. */
import { BufferAttribute, BufferGeometry, type Mesh, type Vector2Like } from "three";
import { Source } from "vrtm/three";

/** Texels along each side in which places are compared. */
const SIZE = 256;

/** Calls a function for the texels whose middles are in a triangle; UVs repeat. */
function texels(corners: Vector2Like[], call: (texel: number) => void): void {
  const [a, b, c] = corners.map(({ x, y }) => ({ x: x * SIZE - 0.5, y: y * SIZE - 0.5 }));
  const area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
  const [left, right] = [Math.min, Math.max].map((most) => most(a.x, b.x, c.x));
  const [low, high] = [Math.min, Math.max].map((most) => most(a.y, b.y, c.y));
  // A triangle over many repeats covers all.
  for (let y = Math.ceil(low); y <= Math.min(high, low + SIZE); y++) {
    for (let x = Math.ceil(left); x <= Math.min(right, left + SIZE); x++) {
      const s = ((b.x - x) * (c.y - y) - (c.x - x) * (b.y - y)) / area;
      const t = ((c.x - x) * (a.y - y) - (a.x - x) * (c.y - y)) / area;
      if (s >= 0 && t >= 0 && s + t <= 1) {
        call((((y % SIZE) + SIZE) % SIZE) * SIZE + (((x % SIZE) + SIZE) % SIZE));
      }
    }
  }
}

interface Chart {
  texels: number[];
  triangles: { mesh: number; corners: number[] }[];
}

/** Divides meshes that share a texture into those whose charts come first, and those that lie over them; the latter are
 * new meshes, children of the former. */
export function layers(meshes: Mesh[], channel: number): Mesh[][] {
  const { vertexOf } = new Source(meshes, { uv: channel });
  const numbers = new Map<string, number>();
  const parent: number[] = [];
  const root = (k: number) => {
    while (parent[k] !== k) {
      k = parent[k] = parent[parent[k]];
    }
    return k;
  };
  const all = meshes.flatMap(({ geometry: { index, attributes } }, mesh) => {
    const uv = attributes[channel === 0 ? "uv" : `uv${channel}`];
    return Array.from({ length: Math.floor((index ?? uv).count / 3) }, (_, k) => {
      const corners = [3 * k, 3 * k + 1, 3 * k + 2].map((corner) => (index ? index.getX(corner) : corner));
      const uvs = corners.map((v) => ({ x: uv.getX(v), y: uv.getY(v) }));
      const [a, b, c] = uvs;
      const area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
      // At a line of symmetry both halves have the same vertices and UVs: they differ in how they turn.
      const own = corners.map((v, corner) => {
        const key = `${vertexOf[mesh][v]} ${uvs[corner].x} ${uvs[corner].y} ${Math.sign(area)}`;
        if (!numbers.has(key)) {
          numbers.set(key, parent.push(parent.length) - 1);
        }
        return numbers.get(key)!;
      });
      own.forEach((number) => (parent[root(number)] = root(own[0])));
      return { mesh, corners, uvs, area, number: own[0] };
    });
  });
  const charts = new Map<number, Chart>();
  all.sort((a, b) => Math.sign(b.area) - Math.sign(a.area)).forEach(({ mesh, corners, uvs, area, number }) => {
    const chart = charts.get(root(number)) ?? { texels: [], triangles: [] };
    charts.set(root(number), chart);
    chart.triangles.push({ mesh, corners });
    if (area !== 0) {
      texels(uvs, (texel) => chart.texels.push(texel));
    }
  });
  const taken = new Uint8Array(SIZE * SIZE);
  const above = [...charts.values()].filter(({ texels }) => {
    const isAbove = texels.filter((texel) => taken[texel]).length > 0.1 * texels.length;
    texels.forEach((texel) => (taken[texel] ||= isAbove ? 0 : 1));
    return isAbove;
  });
  if (above.length === 0) {
    return [meshes];
  }
  const over = new Set(above);
  const pick = (of: Chart[], mesh: number) =>
    of.flatMap(({ triangles }) => triangles.flatMap((triangle) => (triangle.mesh === mesh ? triangle.corners : [])));
  const below = [...charts.values()].filter((chart) => !over.has(chart));
  const [lower, upper] = [below, above].map((of) => meshes.map((_, k) => pick(of, k)));
  const twins = meshes.map((mesh, k) => {
    if (upper[k].length === 0 || lower[k].length === 0) {
      return upper[k].length > 0 ? mesh : null;
    }
    const twin = mesh.clone(false);
    twin.geometry = indexed(mesh.geometry, upper[k]);
    mesh.geometry = indexed(mesh.geometry, lower[k]);
    twin.morphTargetInfluences = mesh.morphTargetInfluences;
    twin.position.set(0, 0, 0);
    twin.quaternion.identity();
    twin.scale.set(1, 1, 1);
    return mesh.add(twin) && twin;
  });
  return [meshes.filter((mesh) => !twins.includes(mesh)), twins.filter((mesh) => mesh !== null)];
}

/** Other triangles of the same vertices. */
function indexed(geometry: BufferGeometry, corners: number[]): BufferGeometry {
  const made = new BufferGeometry();
  const { attributes, morphAttributes, morphTargetsRelative } = geometry;
  Object.assign(made, { attributes, morphAttributes, morphTargetsRelative });
  return made.setIndex(new BufferAttribute(Uint32Array.from(corners), 1));
}
