// Makes examples/web/scenes, a glb and a rigidity map each: `node scenes.mjs FOLDER`, where
// `cargo run --release --example scene -- NAME FOLDER/NAME` has written mug_to_jug and creature. Beside `npm ci` this
// takes `npm install --no-save @gltf-transform/{core,extensions,functions}@4 meshoptimizer@1`, and a Chromium to paint.
import { readFileSync, writeFileSync } from "node:fs";
import { Document, NodeIO } from "@gltf-transform/core";
import {
  ALL_EXTENSIONS, EXTMeshoptCompression, EXTTextureWebP, KHRMaterialsClearcoat,
} from "@gltf-transform/extensions";
import { quantize, reorder } from "@gltf-transform/functions";
import { MeshoptEncoder as encoder } from "meshoptimizer";
import { PNG } from "pngjs";
import puppeteer from "puppeteer-core";
import { BufferAttribute, BufferGeometry } from "three";

// Colours of ground and relief, then of both along the spine; rows of eyes; first faces, which look inward; pose at a
// time of the loop, 0 = rest.
const SCENES = {
  creature: {
    colours: [[20, 108, 84], [240, 224, 176], [8, 52, 56], [240, 138, 62]], metal: 0, eyes: [0.327, 0.127],
    folder: "creature", inward: 2880, seconds: 10, at: (t) => 5 * t - Math.sin(10 * Math.PI * t) / (2 * Math.PI),
  },
  jug: {
    colours: [[23, 64, 127], [239, 190, 103], [15, 47, 102], [239, 190, 103]], metal: 0.7, eyes: [],
    folder: "mug_to_jug", inward: 0, seconds: 6, at: (t) => 2.5 - 2.5 * Math.cos(2 * Math.PI * t),
  },
};

/** Images: rigidity with eyes, base colour, normals, roughness with metal. Runs in Chromium. */
async function paint(png, { colours, metal, eyes }) {
  const N = 1024;
  const context = (size, image) => {
    const to = new OffscreenCanvas(size, size).getContext("2d");
    to.drawImage(image, 0, 0, size, size);
    return to;
  };
  const look = (to, discs) => eyes.forEach((v) => discs.forEach(([colour, r]) => {
    to.fillStyle = colour;
    to.beginPath();
    to.arc(0.87 * to.canvas.width, v * to.canvas.width, r * to.canvas.width, 0, 7);
    to.fill();
  }));
  const rigid = context(N / 2, await createImageBitmap(await (await fetch(`data:image/png;base64,${png}`)).blob()));
  look(rigid, [["#000", 0.031], ["#fff", 0.021]]);
  const values = context(N, rigid.canvas).getImageData(0, 0, N, N).data;
  const at = (x, y) => values[4 * (((y + N) % N) * N + ((x + N) % N))] / 255;
  const mix = (a, b, k) => a.map((from, n) => from + (b[n] - from) * k);
  const images = [0, 1, 2].map(() => new ImageData(N, N));
  for (let n = 0; n < N * N; n++) {
    const [x, y] = [n % N, Math.floor(n / N)];
    const rise = Math.min(1, Math.max(0, 2 * at(x, y) - 0.5));
    const spine = Math.exp(-(((y / N - 0.235) / 0.07) ** 2));
    const [ground, relief] = [0, 1].map((k) => mix(colours[k], colours[k + 2], spine));
    // Lines of equal u and v show how the skin stretches, where there is room for them.
    const line = metal && Math.min(...[x, y].map((n) => Math.abs((n % (N / 48)) - N / 96))) < 1 ? 1.45 : 1;
    const slope = [at(x - 1, y) - at(x + 1, y), at(x, y + 1) - at(x, y - 1), 0.5];
    images[0].data.set([...mix(ground.map((c) => c * line), relief, rise), 255], 4 * n);
    images[1].data.set([...slope.map((s) => 127.5 + (127.5 * s) / Math.hypot(...slope)), 255], 4 * n);
    images[2].data.set([255, 97 + 10 * rise, 255 * metal * rise, 255], 4 * n);
  }
  const bitmaps = await Promise.all(images.map((image) => createImageBitmap(image)));
  const painted = bitmaps.map((bitmap, k) => context(k === 0 ? N : N / 2, bitmap));
  look(painted[0], [["#0a2a26", 0.024], ["#f5b21e", 0.021], ["#14100c", 0.0125]]);
  const files = [rigid, ...painted].map(async ({ canvas }, k) => {
    const file = await canvas.convertToBlob({ type: k === 0 ? "image/png" : "image/webp", quality: 0.85 });
    return [...new Uint8Array(await file.arrayBuffer())];
  });
  return Promise.all(files);
}

/** The scene as a glTF document, with textures. */
function compose(name, obj, frames, images, { inward, seconds, at }) {
  const rows = (key) => obj.split("\n").map((line) => line.split(" ")).filter(([word]) => word === key);
  const numbers = (key) => rows(key).map(([, ...row]) => row.map(Number));
  const [rest, uvs, corners, index] = [numbers("v").flat(), numbers("vt"), new Map(), []];
  rows("f").forEach(([, ...face], k) => {
    const own = (k < inward ? face.reverse() : face).map((corner) => {
      corners.has(corner) || corners.set(corner, corners.size);
      return corners.get(corner);
    });
    own.slice(2).forEach((_, k) => index.push(own[0], own[k + 1], own[k + 2]));
  });
  const pairs = [...corners.keys()].map((corner) => corner.split("/").map((n) => n - 1));
  const welded = new BufferGeometry().setIndex(index.map((k) => pairs[k][0]));
  const shape = (positions) => {
    welded.setAttribute("position", new BufferAttribute(Float32Array.from(positions), 3)).computeVertexNormals();
    const spread = (values) => Float32Array.from(pairs.flatMap(([v]) => [...values.slice(3 * v, 3 * v + 3)]));
    return { POSITION: spread(positions), NORMAL: spread(welded.attributes.normal.array) };
  };
  const starts = Array.from({ length: frames.length / rest.length }, (_, k) => k * rest.length);

  const doc = new Document();
  const buffer = doc.createBuffer();
  const accessor = (type, values) => doc.createAccessor().setType(type).setArray(values).setBuffer(buffer);
  const floats = (type, values) => accessor(type, Float32Array.from(values));
  const primitive = doc.createPrimitive().setIndices(accessor("SCALAR", Uint16Array.from(index)));
  const first = shape(rest);
  const uv = pairs.flatMap(([, uv]) => [uvs[uv][0], 1 - uvs[uv][1]]);
  Object.entries(first).forEach(([key, values]) => primitive.setAttribute(key, floats("VEC3", values)));
  primitive.setAttribute("TEXCOORD_0", floats("VEC2", uv));
  for (const start of starts) {
    const target = doc.createPrimitiveTarget();
    for (const [key, values] of Object.entries(shape(frames.slice(start, start + rest.length)))) {
      target.setAttribute(key, floats("VEC3", values.map((x, n) => x - first[key][n])));
    }
    primitive.addTarget(target);
  }
  const [colour, normal, rough] = images.map((image) => doc.createTexture().setMimeType("image/webp").setImage(image));
  const coat = doc.createExtension(KHRMaterialsClearcoat).createClearcoat();
  coat.setClearcoatFactor(0.45).setClearcoatRoughnessFactor(0.22);
  const material = doc.createMaterial(name).setDoubleSided(true).setBaseColorTexture(colour).setNormalTexture(normal);
  primitive.setMaterial(material.setMetallicRoughnessTexture(rough).setExtension(coat.extensionName, coat));
  const node = doc.createNode(name).setMesh(doc.createMesh(name).addPrimitive(primitive));
  doc.createScene().addChild(node);
  const times = Array.from({ length: 81 }, (_, k) => k / 80);
  const half = (starts.length + 1) / 2;
  // After the last pose comes rest again.
  const away = (t, k) => Math.abs(((at(t) - k - 1 + 3 * half) % (2 * half)) - half);
  const weights = times.flatMap((t) => starts.map((_, k) => Math.max(0, 1 - away(t, k))));
  const sampler = doc.createAnimationSampler().setOutput(floats("SCALAR", weights));
  sampler.setInput(floats("SCALAR", times.map((t) => t * seconds)));
  const channel = doc.createAnimationChannel().setTargetNode(node).setTargetPath("weights").setSampler(sampler);
  doc.createAnimation("loop").addSampler(sampler).addChannel(channel);
  doc.createExtension(EXTTextureWebP).setRequired(true);
  return doc;
}

const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
const browser = await puppeteer.launch({ executablePath, args: ["--no-sandbox"] });
const page = await browser.newPage();
await encoder.ready;
const io = new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies({ "meshopt.encoder": encoder });
for (const [name, scene] of Object.entries(SCENES)) {
  const read = (file) => readFileSync(`${process.argv[2]}/${scene.folder}/${file}`);
  const painted = await page.evaluate(paint, read("rigidity.1001.png").toString("base64"), { ...scene, at: null });
  const [rigidity, ...images] = painted.map((image) => Buffer.from(image));
  const out = new URL(`../../examples/web/scenes/${name}`, import.meta.url).pathname;
  writeFileSync(`${out}.png`, PNG.sync.write(PNG.sync.read(rigidity), { colorType: 0, deflateLevel: 9 }));
  const frames = new Float32Array(Uint8Array.from(read("frames.f32")).buffer);
  const doc = compose(name, read("rest.obj").toString(), frames, images, scene);
  await doc.transform(reorder({ encoder }), quantize({ quantizeTexcoord: 16, quantizeNormal: 8 }));
  doc.createExtension(EXTMeshoptCompression).setRequired(true);
  await io.write(`${out}.glb`, doc);
}
await browser.close();
