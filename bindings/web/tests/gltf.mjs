// A glTF that is made here: a sheet with red discs on its texture, whose middle a skin or a morph target stretches.
import { PNG } from "pngjs";

const COMPONENTS = { Int8Array: 5120, Uint8Array: 5121, Int16Array: 5122, Uint16Array: 5123, Float32Array: 5126 };
export const bytesOf = (array) => Buffer.from(array.buffer, array.byteOffset, array.byteLength);

export class Model {
  json = { asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: [0] }], nodes: [], accessors: [], bufferViews: [] };
  #bytes = Buffer.alloc(0);

  add(list, value) {
    this.json[list] = [...(this.json[list] ?? []), value];
    return this.json[list].length - 1;
  }

  view(bytes, more) {
    const byteOffset = this.#bytes.length;
    this.#bytes = Buffer.concat([this.#bytes, bytes, Buffer.alloc(-bytes.length & 3)]);
    return this.add("bufferViews", { buffer: 0, byteOffset, byteLength: bytes.length, ...more });
  }

  accessor(array, size, more) {
    const [componentType, count] = [COMPONENTS[array.constructor.name], array.length / size];
    const type = ["SCALAR", "VEC2", "VEC3", "VEC4"][size - 1];
    return this.add("accessors", { bufferView: this.view(bytesOf(array)), componentType, count, type, ...more });
  }

  uses(...names) {
    this.json.extensionsUsed = this.json.extensionsRequired = names;
  }

  /** The JSON and the bytes that it names. */
  parts(uri) {
    const bin = this.#bytes;
    return { json: JSON.stringify({ ...this.json, buffers: [{ uri, byteLength: bin.length }] }), bin };
  }

  glb() {
    const { json, bin } = this.parts();
    const text = Buffer.from(json.padEnd((json.length + 3) & ~3));
    const chunk = (type, bytes) => Buffer.concat([bytesOf(new Uint32Array([bytes.length, type])), bytes]);
    const body = Buffer.concat([chunk(0x4e4f534a, text), chunk(0x4e4942, bin)]);
    return Buffer.concat([bytesOf(new Uint32Array([0x46546c67, 2, 12 + body.length])), body]);
  }
}

/** Red discs on sand, which are round on the sheet. */
export function picture(size = 128) {
  const png = new PNG({ width: size, height: size });
  for (let k = 0; k < size * size; k++) {
    // The sheet is twice as long as wide.
    const [x, y] = [2 * k, Math.floor(k / size)].map((at) => (at % (size / 4)) - size / 8 + 0.5);
    png.data.set(Math.hypot(x, y) < size / 13 ? [190, 30, 30, 255] : [225, 200, 150, 255], 4 * k);
  }
  return PNG.sync.write(png);
}

/** Attributes of the sheet: arrays and numbers per vertex. */
export function attributes() {
  const [columns, rows] = [32, 16];
  const points = Array.from({ length: (columns + 1) * (rows + 1) }, (_, k) =>
    [(k % (columns + 1)) / columns, Math.floor(k / (columns + 1)) / rows]);
  const middle = points.map(([s]) => Math.min(1, Math.max(0, 2 * s - 0.5)) ** 2);
  const float = (of) => Float32Array.from(points.flatMap(of));
  const index = [];
  for (let k = 0; k < (columns + 1) * rows; k++) {
    if (k % (columns + 1) < columns) {
      index.push(k, k + 1, k + columns + 2, k, k + columns + 2, k + columns + 1);
    }
  }
  return {
    POSITION: [float(([s, t]) => [2 * s - 1, t - 0.5, 0.15 * Math.sin(4 * s)]), 3],
    NORMAL: [float(() => [0, 0, 1]), 3],
    TEXCOORD_0: [float(([s, t]) => [0.02 + 0.96 * s, 0.98 - 0.96 * t]), 2],
    JOINTS_0: [Uint8Array.from(points.flatMap(() => [0, 1, 0, 0])), 4],
    WEIGHTS_0: [float((_, k) => [1 - middle[k], middle[k], 0, 0]), 4],
    target: [float((_, k) => [0.7 * middle[k], 0, 0]), 3],
    index: [Uint16Array.from(index), 1],
  };
}

const plainly = (model, name, [array, size]) => model.accessor(array, size);

/** The sheet as a model: `moves` by a skin, by a morph target, or not; `change` has its say on attributes first, and
 * `encode` makes the accessors. */
export function sheet({ moves = "skin", image, change = (given) => given, encode = plainly } = {}) {
  const model = new Model();
  const { index, target, JOINTS_0, WEIGHTS_0, ...plain } = change(attributes());
  const all = moves === "skin" ? { ...plain, JOINTS_0, WEIGHTS_0 } : plain;
  const primitive = { attributes: {}, material: 0, indices: model.accessor(...index) };
  for (const [name, given] of Object.entries(all)) {
    primitive.attributes[name] = encode(model, name, given);
  }
  const { POSITION } = primitive.attributes;
  const [min, max] = [Math.min, Math.max].map((most) =>
    [0, 1, 2].map((axis) => most(...plain.POSITION[0].filter((_, k) => k % 3 === axis))));
  Object.assign(model.json.accessors[POSITION], { min, max });
  if (moves === "morph") {
    primitive.targets = [{ POSITION: model.accessor(...target) }];
  }
  model.add("meshes", { primitives: [primitive] });
  model.add("images", image ?? { bufferView: model.view(picture()), mimeType: "image/png" });
  model.add("textures", { source: 0 });
  const pbrMetallicRoughness = { baseColorTexture: { index: 0 }, metallicFactor: 0 };
  model.add("materials", { pbrMetallicRoughness, doubleSided: true });
  model.add("nodes", { mesh: 0 });
  if (moves === "skin") {
    model.json.nodes[0].skin = model.add("skins", { joints: [1, 2] });
    model.add("nodes", {});
    model.add("nodes", {});
    model.json.scenes[0].nodes.push(1, 2);
    const input = model.accessor(Float32Array.of(0, 1), 1, { min: [0], max: [1] });
    const samplers = [{ input, output: model.accessor(Float32Array.of(0, 0, 0, 0.7, 0, 0), 3) }];
    const channels = [{ sampler: 0, target: { node: 2, path: "translation" } }];
    model.add("animations", { name: "stretch", samplers, channels });
  }
  return model;
}

/** A mesh as Draco has it, in its plainest form: sequential, nothing compressed. `attributes` have a type (0 positions,
 * 1 normals, 3 UVs, 4 others), an array and numbers per vertex. */
export function draco(index, attributes) {
  const varint = (n) => (n < 128 ? [n] : [(n & 127) | 128, ...varint(n >> 7)]);
  const kinds = { Uint8Array: 2, Float32Array: 9 };
  const [, [first, size]] = attributes[0];
  return Buffer.concat([
    Buffer.from("DRACO"), Buffer.from([2, 2, 1, 0, 0, 0]),
    Buffer.from([...varint(index.length / 3), ...varint(first.length / size), 1]),
    bytesOf(index), Buffer.from([1, ...varint(attributes.length)]),
    ...attributes.map(([type, [array, size]], id) => Buffer.from([type, kinds[array.constructor.name], size, 0, id])),
    Buffer.from(attributes.map(() => 0)), ...attributes.map(([, [array]]) => bytesOf(array)),
  ]);
}
