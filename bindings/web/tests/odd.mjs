// The sheet of gltf.mjs as other programs write it.
import { attributes, bytesOf, draco, sheet } from "./gltf.mjs";

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
    const [indices, places] = [odd, values].map((array) => ({ bufferView: model.view(bytesOf(array)) }));
    indices.componentType = 5123;
    model.json.accessors[k].sparse = { count: odd.length, indices, values: places };
    return k;
  } }),
  interleaved() {
    const { POSITION, NORMAL, TEXCOORD_0 } = attributes();
    const all = Float32Array.from({ length: 4 * TEXCOORD_0[0].length }, (_, k) => {
      const [[array, size], at] = [[POSITION, 0], [NORMAL, 3], [TEXCOORD_0, 6]].findLast(([, at]) => k % 8 >= at);
      return array[size * (k >> 3) + (k % 8) - at];
    });
    let view;
    return sheet({ encode: (model, name, [array, size]) => {
      const byteOffset = { POSITION: 0, NORMAL: 12, TEXCOORD_0: 24 }[name];
      view ??= model.view(bytesOf(all), { byteStride: 32 });
      const [count, type] = [array.length / size, `VEC${size}`];
      return byteOffset === undefined ? model.accessor(array, size)
        : model.add("accessors", { bufferView: view, byteOffset, componentType: 5126, count, type });
    } });
  },
  draco() {
    const names = ["POSITION", "NORMAL", "TEXCOORD_0", "JOINTS_0", "WEIGHTS_0"];
    const { index, ...given } = attributes();
    const model = sheet();
    const bytes = draco(index[0], names.map((name, k) => [[0, 1, 3, 4, 4][k], given[name]]));
    const ids = Object.fromEntries(names.map((name, k) => [name, k]));
    const [primitive] = model.json.meshes[0].primitives;
    primitive.extensions = { KHR_draco_mesh_compression: { bufferView: model.view(bytes), attributes: ids } };
    const all = [...Object.values(primitive.attributes), primitive.indices];
    all.forEach((k) => delete model.json.accessors[k].bufferView);
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
    const all = Object.fromEntries(Object.entries(given).map(([name, value]) => [name, split(value)]));
    return sheet({ change: () => ({ ...all, index: [index.map((_, k) => k), 1] }) });
  },
  "a mirror and a morph target"() {
    const model = sheet({ moves: "morph" });
    Object.assign(model.json.nodes[0], { scale: [-3, 3, 3], rotation: [0, 0.6, 0, 0.8] });
    return model;
  },
  "an unlit material"() {
    const model = sheet();
    model.json.materials[0].extensions = { KHR_materials_unlit: {} };
    model.uses("KHR_materials_unlit");
    return model;
  },
};
