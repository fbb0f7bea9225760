/** Meshes of three.js as one mesh of vrtm, and its poses: skins and morph targets as three.js has them. */
import { Matrix4, type Mesh, type Object3D, type SkinnedMesh, type Texture } from "three";
import type { Mesh as Surface } from "../index.js";
import { layout, numbers } from "./layout.js";

export interface SourceOptions {
  /** Number of the UV set that the textures use, their `channel`: 0 = `uv`, 1 = `uv1`. By default 0. */
  uv?: number;
}

/** A mesh with its attributes as plain numbers. */
interface Part {
  mesh: Mesh;
  /** Three numbers per vertex. */
  positions: Float32Array;
  morphs: Float32Array[];
  /** Four bones and weights per vertex, bones ascending; absent without a skin. */
  skin?: { bones: Float32Array; weights: Float32Array };
  /** Own vertices that stand for the welded ones `welded`. */
  own: Uint32Array;
  welded: Uint32Array;
}

const isSkinned = (mesh: Mesh): mesh is SkinnedMesh => (mesh as SkinnedMesh).isSkinnedMesh === true;

/** The surface of meshes that share textures. Poses are in one space: the first mesh's own when the source was made.
 * Motion of the topmost object that held it then is none of the pose. */
export class Source {
  readonly mesh: Surface & { positions: Float32Array; uvs: Float32Array; uvIndices: Uint32Array };
  /** Per mesh, the welded vertex of each of its own. */
  readonly vertexOf: Uint32Array[];
  /** The images' first rows are at v = 1 in the meshes' own UVs, and not at v = 0, as in glTF. vrtm always has them at
   * v = 1: its v is 1 - v of the meshes where this is false. */
  readonly flipY: boolean;
  #parts: Part[];
  #top: Object3D;
  /** From the topmost object to the space of poses. */
  #space: Matrix4;

  constructor(meshes: Mesh[], { uv = 0 }: SourceOptions = {}) {
    const [first] = meshes;
    this.#top = first;
    while (this.#top.parent) {
      this.#top = this.#top.parent;
    }
    this.#top.updateMatrixWorld();
    this.#space = first.matrixWorld.clone().invert().multiply(this.#top.matrixWorld);
    const texture = [first.material].flat().flatMap((material) => Object.values(material))
      .find((value: Texture | null) => value?.isTexture);
    this.flipY = texture?.flipY ?? false;
    this.#parts = meshes.map(read);
    const rests = this.#parts.map((part) => atRest(part, first.matrixWorld));
    const { vertexOf, positions } = join(this.#parts, rests);
    this.vertexOf = vertexOf;
    this.mesh = { positions, ...layout(meshes, vertexOf, uv, this.flipY) };
  }

  /** Takes positions of poses to the world, now. */
  get matrixWorld(): Matrix4 {
    return this.#top.matrixWorld.clone().multiply(this.#space.clone().invert());
  }

  /** Positions at rest: skins as they were bound, in the size that their bones give them, and no morph target. */
  rest(): Float32Array {
    return this.mesh.positions;
  }

  /** Positions for the present bones, morph influences and places of the meshes. */
  pose(into = new Float32Array(this.mesh.positions.length)): Float32Array {
    this.#top.updateMatrixWorld();
    const toSpace = this.#space.clone().multiply(this.#top.matrixWorld.clone().invert());
    for (const part of this.#parts) {
      pose(part, toSpace, into);
    }
    return into;
  }
}

function read(mesh: Mesh): Part {
  const { position, skinIndex, skinWeight } = mesh.geometry.attributes;
  const positions = numbers(position, 3);
  const morphs = (mesh.geometry.morphAttributes.position ?? []).map((morph) => numbers(morph, 3));
  const none = new Uint32Array(0);
  const part: Part = { mesh, positions, morphs, own: none, welded: none };
  if (isSkinned(mesh) && skinIndex && skinWeight) {
    // Sorted, so that equal skins are equal numbers.
    const [bones, weights] = [numbers(skinIndex, 4), numbers(skinWeight, 4)].map((array) => array.slice());
    for (let v = 0; v < bones.length; v += 4) {
      const slots = [0, 1, 2, 3].map((k) => ({ weight: weights[v + k], bone: weights[v + k] && bones[v + k] }));
      slots.sort((a, b) => a.bone - b.bone || a.weight - b.weight).forEach(({ bone, weight }, k) => {
        bones[v + k] = bone;
        weights[v + k] = weight;
      });
    }
    part.skin = { bones, weights };
  }
  return part;
}

/** The bones' motion from where they were bound, in the world. */
const motions = ({ skeleton }: SkinnedMesh): Matrix4[] =>
  skeleton.bones.map((bone, k) => bone.matrixWorld.clone().multiply(skeleton.boneInverses[k]));

function atRest({ mesh, positions, skin }: Part, space: Matrix4): Float32Array {
  const matrix = space.clone().invert();
  if (skin && isSkinned(mesh)) {
    // Bones give a skin its size, too: that of the median is no animation.
    const all = motions(mesh).map((motion) => ({ motion, size: Math.cbrt(Math.abs(motion.determinant())) }));
    const median = all.map(({ size }) => size).sort((a, b) => a - b)[all.length >> 1];
    const usual = all.find(({ size }) => Math.abs(size - median) <= 1e-3 * median) ?? all[0];
    matrix.multiply(usual.motion).multiply(mesh.bindMatrix);
  } else {
    matrix.multiply(mesh.matrixWorld);
  }
  const out = new Float32Array(positions.length);
  const e = matrix.elements;
  for (let k = 0; k < out.length; k += 3) {
    const [x, y, z] = [positions[k], positions[k + 1], positions[k + 2]];
    for (let row = 0; row < 3; row++) {
      out[k + row] = e[row] * x + e[row + 4] * y + e[row + 8] * z + e[row + 12];
    }
  }
  return out;
}

/** Welds vertices that coincide at rest and move alike, as importers split them at seams, and lets one of each stand
 * for it. Those of different meshes are welded if one skeleton alone moves both: morph influences and places of meshes
 * may change apart. */
function join(parts: Part[], rests: Float32Array[]) {
  const moved = parts.map(({ mesh, morphs }) => (isSkinned(mesh) && morphs.length === 0 ? mesh.skeleton : mesh));
  const found = new Map<string, number>();
  const places: number[] = [];
  const vertexOf = parts.map((part, p) => {
    const own: number[] = [];
    const welded: number[] = [];
    const columns = [
      ...[rests[p], ...part.morphs].map((values) => ({ values, size: 3 })),
      ...(part.skin ? [part.skin.bones, part.skin.weights].map((values) => ({ values, size: 4 })) : []),
    ];
    const row = new Float32Array(columns.reduce((sum, { size }) => sum + size, 1));
    row[0] = moved.indexOf(moved[p]);
    const characters = new Uint16Array(row.buffer);
    const map = Uint32Array.from({ length: part.positions.length / 3 }, (_, v) => {
      let at = 1;
      for (const { values, size } of columns) {
        for (let k = size * v; k < size * (v + 1); k++) {
          // 0 and -0 are the same.
          row[at++] = values[k] + 0;
        }
      }
      const key = String.fromCharCode(...characters);
      const same = found.get(key);
      if (same !== undefined) {
        return same;
      }
      const n = places.length / 3;
      found.set(key, n);
      places.push(...rests[p].subarray(3 * v, 3 * v + 3));
      own.push(v);
      welded.push(n);
      return n;
    });
    part.own = Uint32Array.from(own);
    part.welded = Uint32Array.from(welded);
    return map;
  });
  return { vertexOf, positions: Float32Array.from(places) };
}

/** The positions of a part's welded vertices. */
function pose({ mesh, positions, morphs, skin, own, welded }: Part, toSpace: Matrix4, into: Float32Array): void {
  const influences = mesh.morphTargetInfluences ?? [];
  const active = morphs.map((offsets, k) => ({ offsets, share: influences[k] ?? 0 })).filter(({ share }) => share);
  // Targets that are no offsets take the share of the mesh's own positions.
  const rest = mesh.geometry.morphTargetsRelative ? 1 : active.reduce((sum, { share }) => sum - share, 1);
  const place = toSpace.clone().multiply(mesh.matrixWorld);
  let matrices = [place];
  if (skin && isSkinned(mesh)) {
    place.multiply(mesh.bindMatrixInverse);
    matrices = motions(mesh).map((motion) => motion.premultiply(place).multiply(mesh.bindMatrix));
  }
  // The place is no part of the weighted sum, and the sum of weights may be other than 1.
  const [tx, ty, tz] = place.elements.slice(12);
  const rows = Float64Array.from(matrices.flatMap((matrix) => matrix.transpose().elements.slice(0, 12)));
  for (let n = 0; n < own.length; n++) {
    const v = 3 * own[n];
    let x = rest * positions[v];
    let y = rest * positions[v + 1];
    let z = rest * positions[v + 2];
    for (const { offsets, share } of active) {
      x += share * offsets[v];
      y += share * offsets[v + 1];
      z += share * offsets[v + 2];
    }
    let px = 0;
    let py = 0;
    let pz = 0;
    let left = 1;
    for (let k = 0; k < (skin ? 4 : 1); k++) {
      const weight = skin ? skin.weights[4 * own[n] + k] : 1;
      if (weight !== 0) {
        const m = skin ? 12 * skin.bones[4 * own[n] + k] : 0;
        px += weight * (rows[m] * x + rows[m + 1] * y + rows[m + 2] * z + rows[m + 3]);
        py += weight * (rows[m + 4] * x + rows[m + 5] * y + rows[m + 6] * z + rows[m + 7]);
        pz += weight * (rows[m + 8] * x + rows[m + 9] * y + rows[m + 10] * z + rows[m + 11]);
        left -= weight;
      }
    }
    const to = 3 * welded[n];
    into[to] = px + left * tx;
    into[to + 1] = py + left * ty;
    into[to + 2] = pz + left * tz;
  }
}
