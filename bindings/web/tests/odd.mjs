// The sheet of gltf.mjs as other programs write it.
import { attributes, bytesOf, draco, meshopt, sheet } from "./gltf.mjs";

export const float = (given, name, of) => ({ ...given, [name]: [given[name][0].map(of), given[name][1]] });
/** Its strain is always the same. */
export const SAME = {
  quantised() {
    const model = sheet({ encode: (model, name, [array, size]) => {
      const kinds = { POSITION: [Int16Array, 32767], NORMAL: [Int8Array, 127], JOINTS_0: [Uint8Array, 1] };
      const [Kind, most] = kinds[name] ?? [Uint16Array, 65535];
      // Vertices begin at multiples of four bytes.
      const stride = Math.ceil((size * Kind.BYTES_PER_ELEMENT) / 4) * 4;
      const apart = stride / Kind.BYTES_PER_ELEMENT;
      const padded = new Kind((array.length / size) * apart);
      array.forEach((x, k) => (padded[Math.floor(k / size) * apart + (k % size)] = Math.round(most * x)));
      const k = model.accessor(padded, size, { count: array.length / size, normalized: most > 1 });
      model.json.bufferViews.at(-1).byteStride = stride;
      return k;
    } });
    model.uses("KHR_mesh_quantization");
    return model;
  },
  sparse: () => sheet({ encode: (model, name, [array, size]) => {
    if (name !== "POSITION") {
      return model.accessor(array, size);
    }
    // Every other place is in the base, the others are sparse.
    const k = model.accessor(array.map((x, n) => (Math.floor(n / 3) % 2 ? 0 : x)), size);
    const odd = Uint16Array.from({ length: Math.floor(array.length / 6) }, (_, n) => 2 * n + 1);
    const values = Float32Array.from([...odd].flatMap((n) => [...array.subarray(3 * n, 3 * n + 3)]));
    model.json.accessors[k].sparse = { count: odd.length, indices: { bufferView: model.view(bytesOf(odd)), componentType: 5123 },
      values: { bufferView: model.view(bytesOf(values)) } };
    return k;
  } }),
  interleaved() {
    const { POSITION: [positions], NORMAL: [normals], TEXCOORD_0: [uvs] } = attributes();
    const all = new Float32Array(8 * (uvs.length / 2));
    for (let v = 0; v < uvs.length / 2; v++) {
      all.set([...positions.subarray(3 * v, 3 * v + 3), ...normals.subarray(3 * v, 3 * v + 3), ...uvs.subarray(2 * v, 2 * v + 2)], 8 * v);
    }
    let view;
    return sheet({ encode: (model, name, [array, size]) => {
      const byteOffset = { POSITION: 0, NORMAL: 12, TEXCOORD_0: 24 }[name];
      view ??= model.view(bytesOf(all), { byteStride: 32 });
      return byteOffset === undefined ? model.accessor(array, size)
        : model.add("accessors", { bufferView: view, byteOffset, componentType: 5126, count: array.length / size, type: `VEC${size}` });
    } });
  },
  meshopt() {
    const model = sheet({ encode: (model, name, [array, size]) => {
      const [count, byteStride] = [array.length / size, size * array.BYTES_PER_ELEMENT];
      const bytes = meshopt(bytesOf(array), byteStride);
      const k = model.accessor(new array.constructor(array.length), size);
      model.view(bytes);
      const { byteOffset, byteLength } = model.json.bufferViews.pop();
      const extension = { buffer: 0, byteOffset, byteLength, byteStride, count, mode: "ATTRIBUTES" };
      model.json.bufferViews.at(-1).extensions = { EXT_meshopt_compression: extension };
      return k;
    } });
    model.uses("EXT_meshopt_compression");
    return model;
  },
  draco() {
    const names = ["POSITION", "NORMAL", "TEXCOORD_0", "JOINTS_0", "WEIGHTS_0"];
    const { index, ...given } = attributes();
    const model = sheet();
    const bytes = draco(index[0], names.map((name, k) => [[0, 1, 3, 4, 4][k], given[name]]));
    const ids = Object.fromEntries(names.map((name, k) => [name, k]));
    const [primitive] = model.json.meshes[0].primitives;
    primitive.extensions = { KHR_draco_mesh_compression: { bufferView: model.view(bytes), attributes: ids } };
    Object.values(primitive.attributes).concat(primitive.indices).forEach((k) => delete model.json.accessors[k].bufferView);
    model.uses("KHR_draco_mesh_compression");
    return model;
  },
  "its colour in the second UV set"() {
    const model = sheet({ change: ({ TEXCOORD_0, ...given }) =>
      ({ ...given, TEXCOORD_0: [new Float32Array(TEXCOORD_0[0].length), 2], TEXCOORD_1: TEXCOORD_0 }) });
    model.json.materials[0].pbrMetallicRoughness.baseColorTexture.texCoord = 1;
    return model;
  },
  "a texture transform"() {
    const model = sheet({ change: (given) => float(given, "TEXCOORD_0", (x) => 0.1 + 0.8 * x) });
    const transform = { offset: [-0.125, -0.125], scale: [1.25, 1.25] };
    model.json.materials[0].pbrMetallicRoughness.baseColorTexture.extensions = { KHR_texture_transform: transform };
    model.uses("KHR_texture_transform");
    return model;
  },
  "UVs three tiles away": () => sheet({ change: (given) => float(given, "TEXCOORD_0", (x, k) => (k % 2 ? x : x + 3)) }),
  "vertices split at each corner"() {
    const { index: [index], ...given } = attributes();
    const split = ([array, size]) =>
      [array.constructor.from([...index].flatMap((v) => [...array.subarray(size * v, size * v + size)])), size];
    return sheet({ change: () => ({ ...Object.fromEntries(Object.entries(given).map(([name, value]) => [name, split(value)])),
      index: [index.map((_, k) => k), 1] }) });
  },
  "a mirror and a morph target"() {
    const model = sheet({ moves: "morph" });
    Object.assign(model.json.nodes[0], { scale: [-3, 3, 3], rotation: [0, 0.6, 0, 0.8] });
    return model;
  },
  "cameras and lights"() {
    const model = sheet();
    model.add("cameras", { type: "perspective", perspective: { yfov: 1, znear: 0.1 } });
    model.json.extensions = { KHR_lights_punctual: { lights: [{ type: "point" }] } };
    model.json.extensionsUsed = ["KHR_lights_punctual"];
    model.json.scenes[0].nodes.push(model.add("nodes", { camera: 0, extensions: { KHR_lights_punctual: { light: 0 } } }));
    return model;
  },
  "an unlit material"() {
    const model = sheet();
    model.json.materials[0].extensions = { KHR_materials_unlit: {} };
    model.uses("KHR_materials_unlit");
    return model;
  },
};
