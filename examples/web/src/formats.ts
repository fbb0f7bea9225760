/** Files that other programs read: pixels as PNG and EXR, motion as USD. */
import { DataTexture, FloatType, HalfFloatType, RGBAFormat } from "three";
import { EXRExporter } from "three/addons/exporters/EXRExporter.js";
import { zlibSync } from "three/addons/libs/fflate.module.js";
import type { Source } from "vrtm/three";

/** PNG of one channel (grey) or three, with 8 or 16 bits; the first row is at the top. */
export function png(size: number, channels: 1 | 3, values: Uint8Array | Uint16Array): Uint8Array {
  const bytes = values.BYTES_PER_ELEMENT;
  const row = size * channels * bytes;
  // Each row begins with its filter: none.
  const lines = new Uint8Array(size * (row + 1));
  for (let k = 0; k < size * row; k++) {
    lines[k + 1 + Math.floor(k / row)] = bytes === 1 ? values[k] : values[k >> 1] >> (k & 1 ? 0 : 8);
  }
  const chunk = (kind: string, data: Uint8Array) => {
    const made = Uint8Array.from([0, 0, 0, 0, ...new TextEncoder().encode(kind), ...new Array(data.length + 4)]);
    made.set(data, 8);
    let crc = ~0;
    for (let k = 4; k < made.length - 4; k++) {
      crc ^= made[k];
      for (let bit = 0; bit < 8; bit++) {
        crc = (crc >>> 1) ^ (crc & 1 && 0xedb88320);
      }
    }
    new DataView(made.buffer).setUint32(0, data.length);
    new DataView(made.buffer).setUint32(data.length + 8, ~crc);
    return made;
  };
  const side = [size >> 24, size >> 16, size >> 8, size];
  const head = Uint8Array.of(...side, ...side, 8 * bytes, channels === 1 ? 0 : 2, 0, 0, 0);
  const chunks = [chunk("IHDR", head), chunk("IDAT", zlibSync(lines)), chunk("IEND", new Uint8Array())];
  return Uint8Array.from([137, 80, 78, 71, 13, 10, 26, 10, ...chunks.flatMap((made) => [...made])]);
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
