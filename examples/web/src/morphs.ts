/** glTF of meshes with morph targets of positions and UVs, as `vrtm bake --gltf` has them. */
import {
  AnimationClip, BufferAttribute, BufferGeometry, Mesh, NumberKeyframeTrack, Scene, type Object3D,
} from "three";
import { GLTFExporter, type GLTFExporterPlugin, type GLTFWriter } from "three/addons/exporters/GLTFExporter.js";
import { fit, lookUp, type Basis } from "vrtm/three";
import type { Part } from "./state.js";

/** The most that positions may be off by, as a share of the mesh's size; and UVs between vertices, as far as so many
 * triangles of a mesh allow. */
const SHAPE = 5e-4;
const BETWEEN = 8 / 4096;
const TRIANGLES = 100_000;

export interface Morphing {
  mesh: Mesh;
  /** Changes of UVs: one per target. */
  uvs: BufferAttribute[];
  /** Weights of all targets in each frame. */
  weights: number[][];
}

type Pairs = [number, number][];

const key = (a: number, b: number): string => (a < b ? `${a} ${b}` : `${b} ${a}`);

/** The edges of triangles. */
function edges(corners: number[]): Pairs {
  const ends = corners.map((a, k): [number, number] => [a, corners[k % 3 === 2 ? k - 2 : k + 1]]);
  return [...new Map(ends.map((pair) => [key(...pair), pair])).values()];
}

/** Cuts triangles in two at the middle of these edges, and of the longest edge of each such triangle, there first, or
 * they would become ever narrower. Gives all of these edges, whose middles are the new vertices. */
function cut(corners: number[], far: Pairs, uvs: number[]): { corners: number[]; pairs: Pairs } {
  const length = ([a, b]: number[]) => Math.hypot(uvs[2 * a] - uvs[2 * b], uvs[2 * a + 1] - uvs[2 * b + 1]);
  const longest = (turns: number[][]) => turns.reduce((long, turn) => (length(turn) > length(long) ? turn : long));
  const turned = (a: number, b: number, c: number) => [[a, b, c], [b, c, a], [c, a, b]];
  const triangles = corners.flatMap((a, k) => (k % 3 === 0 ? [turned(a, corners[k + 1], corners[k + 2])] : []));
  const pairs = new Map(far.map((pair) => [key(...pair), pair]));
  for (let before = 0; before < pairs.size; ) {
    before = pairs.size;
    for (const turns of triangles.filter((turns) => turns.some(([a, b]) => pairs.has(key(a, b))))) {
      const [a, b] = longest(turns);
      pairs.set(key(a, b), [a, b]);
    }
  }
  const middles = new Map([...pairs.keys()].map((name, k) => [name, uvs.length / 2 + k]));
  const one = (turns: number[][]): number[] => {
    const open = turns.filter(([a, b]) => middles.has(key(a, b)));
    if (open.length === 0) {
      return turns[0];
    }
    const [a, b, c] = longest(open);
    const p = middles.get(key(a, b))!;
    return [...one(turned(p, b, c)), ...one(turned(a, p, c))];
  };
  return { corners: triangles.flatMap(one), pairs: [...pairs.values()] };
}

/** The means of pairs of rows with so many numbers. */
function means(values: ArrayLike<number>, width: number, pairs: Pairs): number[] {
  const row = Array.from({ length: width }, (_, c) => c);
  return pairs.flatMap(([a, b]) => row.map((c) => (values[a * width + c] + values[b * width + c]) / 2));
}

/** What each map adds to UVs of a mesh. */
function lookedUp({ maps, size }: Basis, uvs: number[], flipY: boolean): number[][] {
  return maps.map((map) =>
    uvs.flatMap((u, k) => (k % 2 === 0 ? lookUp(map, size, u, uvs[k + 1], flipY) : [])));
}

/** The shapes that weights make poses of, nearest in the mean square, and those of what is left, with more weights. */
async function shapesOf(rest: Float32Array, poses: Float32Array[], weights: number[][], tick: () => Promise<void>) {
  const left = poses.map((pose) => pose.map((x, k) => x - rest[k]));
  const shapes = weights[0].map((_, k) => {
    const square = weights.reduce((sum, of) => sum + of[k] ** 2, 0);
    const shape = rest.map((_, n) => weights.reduce((sum, of, f) => sum + of[k] * left[f][n], 0) / square);
    left.forEach((row, f) => shape.forEach((x, n) => (row[n] -= weights[f][k] * x)));
    return shape;
  });
  const sides = [0, 1, 2].map((axis) => rest.filter((_, k) => k % 3 === axis).sort());
  const bound = SHAPE * Math.max(...sides.map((side) => side[side.length - 1] - side[0]));
  const further = await fit(left, { bound, components: 3, tick });
  return { shapes: [...shapes, ...further.maps], weights: weights.map((of, f) => [...of, ...further.weights[f]]) };
}

/** Meshes of a part with targets, cut until UVs between vertices are near enough, with the number of targets that leave
 * UVs alone, and the largest error of UVs in the middle of an edge. */
export async function morphing(
  { source, meshes }: Part,
  name: string,
  poses: Float32Array[],
  basis: Basis,
  tick: () => Promise<void>,
) {
  const { flipY } = source;
  const { shapes, weights } = await shapesOf(source.rest(), poses, basis.weights, tick);
  let error = 0;
  const made = meshes.map((own, m): Morphing => {
    const { index, attributes: { uv } } = own.geometry;
    const welded = Array.from(source.vertexOf[m]);
    const rowOf = (row: Float32Array) => welded.flatMap((v) => [row[3 * v], row[3 * v + 1], row[3 * v + 2]]);
    let rows = [source.rest(), ...shapes].map(rowOf);
    let uvs = welded.flatMap((_, v) => [uv.getX(v), uv.getY(v)]);
    let corners = index ? Array.from(index.array) : welded.map((_, v) => v);
    for (;;) {
      const moves = lookedUp(basis, uvs, flipY);
      const all = edges(corners);
      const left = lookedUp(basis, means(uvs, 2, all), flipY).map((move, k) => {
        const mean = means(moves[k], 2, all);
        return move.map((x, n) => x - mean[n]);
      });
      const off = all.map((_, n) => Math.max(...basis.weights.map((of) =>
        Math.hypot(...[2 * n, 2 * n + 1].map((at) => left.reduce((sum, move, k) => sum + of[k] * move[at], 0))))));
      const far = all.filter((_, n) => off[n] > BETWEEN);
      if (far.length === 0 || corners.length > 3 * TRIANGLES) {
        error = off.reduce((most, x) => Math.max(most, x), error);
        break;
      }
      const halves = cut(corners, far, uvs);
      corners = halves.corners;
      uvs = [...uvs, ...means(uvs, 2, halves.pairs)];
      rows = rows.map((row) => [...row, ...means(row, 3, halves.pairs)]);
    }
    const moves = lookedUp(basis, uvs, flipY);
    const attribute = (values: number[], width: number) => new BufferAttribute(Float32Array.from(values), width);
    const [positions, ...targets] = rows.map((row) => attribute(row, 3));
    const geometry = new BufferGeometry().setIndex(corners).setAttribute("position", positions);
    geometry.setAttribute("uv", attribute(uvs, 2));
    geometry.morphAttributes.position = targets;
    geometry.morphTargetsRelative = true;
    const mesh = Object.assign(new Mesh(geometry, [own.material].flat()[0]), { name: own.name || name });
    const named = targets.map((_, k) => (k < moves.length ? `basis ${k + 1}` : `shape ${k + 1 - moves.length}`));
    mesh.morphTargetDictionary = Object.fromEntries(named.map((target, k) => [target, k]));
    mesh.morphTargetInfluences = named.map(() => 0);
    mesh.applyMatrix4(source.matrixWorld);
    const still = attribute(uvs.map(() => 0), 2);
    return { mesh, weights, uvs: named.map((_, k) => (k < moves.length ? attribute(moves[k], 2) : still)) };
  });
  return { meshes: made, shapes: shapes.length - basis.maps.length, error };
}

/** Binary glTF whose morph targets have `POSITION` and `TEXCOORD_0`, with an animation of their weights. */
export async function glb(all: Morphing[], times: number[]): Promise<Uint8Array> {
  // three.js writes targets of positions alone, and has a hook for what is more.
  const plugin = (writer: GLTFWriter & { processAccessor?: Function }): GLTFExporterPlugin => ({
    writeMesh(mesh: Object3D, { primitives: [{ targets = [] }] }: { [key: string]: any }) {
      // All primitives share one list of targets.
      const { uvs } = all.find((one) => one.mesh === mesh)!;
      targets.forEach((target: Record<string, number>, k: number) =>
        (target.TEXCOORD_0 = writer.processAccessor!(uvs[k], (mesh as Mesh).geometry)));
    },
  });
  const tracks = all.filter(({ uvs }) => uvs.length > 0).map(({ mesh, weights }) =>
    new NumberKeyframeTrack(`${mesh.uuid}.morphTargetInfluences`, times, weights.flat()));
  const scene = new Scene().add(...all.map(({ mesh }) => mesh));
  const animations = [new AnimationClip("motion", -1, tracks)];
  const file = await new GLTFExporter().register(plugin).parseAsync(scene, { binary: true, animations });
  return new Uint8Array(file as ArrayBuffer);
}
