/** Files that other programs read: pixels as PNG and EXR, motion as USD. */
import { DataTexture, FloatType, HalfFloatType, RGBAFormat } from "three";
import { EXRExporter } from "three/addons/exporters/EXRExporter.js";
import type { Source } from "vrtm/three";

/** PNG of grey values; the first row is at the top. */
export async function png(size: number, values: Uint8Array): Promise<Uint8Array> {
  const canvas = new OffscreenCanvas(size, size);
  const rgba = Uint8ClampedArray.from({ length: 4 * size * size }, (_, k) => (k % 4 === 3 ? 255 : values[k >> 2]));
  canvas.getContext("2d")!.putImageData(new ImageData(rgba, size, size), 0, 0);
  return new Uint8Array(await (await canvas.convertToBlob()).arrayBuffer());
}

/** EXR of two numbers per texel, u in R and v in G, as floats or half floats; the first row is at the top. */
export function exr(size: number, values: Float32Array | Uint16Array): Promise<Uint8Array> {
  const half = values instanceof Uint16Array;
  const pixels = half ? new Uint16Array(4 * size * size) : new Float32Array(4 * size * size);
  for (let y = 0; y < size; y++) {
    for (let x = 0; x < size; x++) {
      // three.js has the last row first.
      const k = y * size + x;
      pixels.set([values[2 * k], values[2 * k + 1], 0, half ? 0x3c00 : 1], 4 * ((size - 1 - y) * size + x));
    }
  }
  const type = half ? HalfFloatType : FloatType;
  return new EXRExporter().parse(new DataTexture(pixels, size, size, RGBAFormat, type), { type });
}

/** A mesh in motion, as vrtm has it. */
export interface Moving {
  name: string;
  mesh: Source["mesh"];
  /** Positions of each frame. */
  poses: Float32Array[];
}

/** A USD scene of meshes with their shapes at rest (`Pref`), UVs (`st`), and a time sample per frame, from 1 on. */
export function usda(meshes: Moving[], rate: number): string {
  // Nine digits are a float's.
  const list = (values: ArrayLike<number>, width: number) => {
    const texts = Array.from(values, (x) => String(+x.toPrecision(9)));
    const rows = texts.flatMap((_, k) => (k % width ? [] : [`(${texts.slice(k, k + width).join(", ")})`]));
    return `[${(width === 1 ? texts : rows).join(", ")}]`;
  };
  const prims = meshes.map(({ name, mesh, poses }) => `def Mesh "${name}" {
  uniform token subdivisionScheme = "none"
  int[] faceVertexCounts = ${list(mesh.faceCounts!, 1)}
  int[] faceVertexIndices = ${list(mesh.indices, 1)}
  texCoord2f[] primvars:st = ${list(mesh.uvs, 2)} (interpolation = "faceVarying")
  int[] primvars:st:indices = ${list(mesh.uvIndices, 1)}
  point3f[] primvars:Pref = ${list(mesh.positions, 3)} (interpolation = "vertex")
  point3f[] points.timeSamples = {
${poses.map((pose, k) => `    ${k + 1}: ${list(pose, 3)},`).join("\n")}
  }
}`);
  const frames = Math.max(...meshes.map(({ poses }) => poses.length));
  return `#usda 1.0
(
  startTimeCode = 1
  endTimeCode = ${frames}
  timeCodesPerSecond = ${rate}
  framesPerSecond = ${rate}
  metersPerUnit = 1
  upAxis = "Y"
)
${prims.join("\n")}
`;
}
