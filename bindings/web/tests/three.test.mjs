// vrtm/three by its pictures: three.js draws strips in a browser, and own arithmetic measures them.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { launch, serve, skip } from "./browser.mjs";

const PAGE = `<!doctype html><link rel="icon" href="data:,"><script type="importmap">{ "imports": {
  "three": "/node_modules/three/build/three.module.js", "vrtm/three": "/dist/three/index.js" } }</script>
  <script type="module" src="/tests/three_strip.js"></script>`;
const options = { skip, timeout: 600_000 };
let browser, served, page;
const problems = [];
before(async () => {
  if (!skip) {
    served = await serve(fileURLToPath(new URL("..", import.meta.url)), PAGE);
    browser = await launch();
    page = await browser.newPage();
    page.setDefaultTimeout(300_000);
    page.on("console", (message) => ["error", "warn"].includes(message.type()) && problems.push(message.text()));
    page.on("pageerror", (error) => problems.push(error.message));
    await page.goto(served.url);
    await page.waitForFunction("window.stretched");
  }
});
after(async () => {
  await browser?.close();
  served?.server.close();
});

/** Runs a function in the page, where three_strip.js is. */
async function inPage(...given) {
  const value = await page.evaluate(...given);
  assert.deepEqual(problems, []);
  return value;
}

test("studs on skinned and on morphing meshes stay round, and rays find their paint", options, async () => {
  for (const skinned of [true, false]) {
    const { own, got, found } = await inPage(async (skinned) => {
      const material = new THREE.MeshStandardMaterial({ map: paint(true), roughness: 1 });
      const materials = skinned ? material : [material, material.clone()];
      const { mesh, redirected } = await stretched({ material: materials, skinned }, "normal");
      const got = ellipses(picture(mesh));
      mesh.updateWorldMatrix(true, true);
      const found = got.map(({ at }) => {
        const ray = new THREE.Raycaster();
        ray.setFromCamera(at, camera);
        const uv = redirected.uvAt(ray.intersectObject(mesh)[0].uv).subScalar(0.5);
        return Math.min(...STUDS.map(([x, y]) => Math.hypot(uv.x - x, uv.y - y)));
      });
      redirected.dispose();
      return { own: ellipses(picture(mesh)), got, found };
    }, skinned);
    assert.deepEqual([own.length, got.length], [9, 9]);
    for (const [k, { aspect, area }] of got.entries()) {
      // A pixel more or less on a diameter of 56 is .018.
      assert.ok(Math.abs(own[k].aspect - 1.6) < 0.02 && aspect < 1.05, `${own[k].aspect} -> ${aspect}`);
      // A stud at rest has the radius .06 of a strip with a side of 470.6 pixels.
      assert.ok(Math.abs(area / (Math.PI * (0.06 * 470.6) ** 2) - 1) < 0.03, `${area} pixels`);
      assert.ok(found[k] < 0.002, `${found[k]} from the middle of a stud`);
    }
  }
});

test("each texture, its transform and its tangents are those of a mesh with redirected UVs", options, async () => {
  for (const flipY of [true, false]) {
    const measured = await inPage(async (flipY) => {
      const [map, normalMap, turned] = [paint(flipY), relief(flipY), relief(flipY)];
      const { redirected } = await stretched({ material: new THREE.MeshStandardMaterial({ map }), flipY, shear: 0.5 });
      turned.rotation = 0.4;
      turned.repeat.set(1.5, 0.8);
      turned.offset.set(0.1, 0.2);
      const physical = { clearcoat: 1, sheen: 1, sheenColor: 0xffffff, transmission: 0.3, iridescence: 1 };
      physical.metalness = 1;
      const slots = "roughness metalness sheenColor iridescence specularColor transmission thickness alpha clearcoat";
      slots.split(" ").forEach((slot) => (physical[`${slot}Map`] = map));
      const fine = exact(redirected, flipY, 0.5);
      const compare = (Material, values, hasTangents = false) => {
        const material = new Material(values);
        const { mesh, pose } = strip({ material, flipY, shear: 0.5 });
        const want = new THREE.Mesh(fine.clone(), material);
        [mesh, want].forEach(({ geometry }) => hasTangents && geometry.computeTangents());
        pose(1);
        const wanted = picture(want);
        const own = difference(picture(mesh), wanted).mean;
        patch(material, redirected.uniforms, { flipY });
        return { own, got: difference(picture(mesh), wanted).mean };
      };
      const all = {
        turned: compare(THREE.MeshStandardMaterial, { normalMap: turned, roughness: 0.5 }),
        normal: compare(THREE.MeshStandardMaterial, { normalMap, roughness: 0.5 }),
        tangents: compare(THREE.MeshStandardMaterial, { normalMap, roughness: 0.5 }, true),
        unlit: compare(THREE.MeshBasicMaterial, { map }),
      };
      if (flipY) {
        all.bump = compare(THREE.MeshStandardMaterial, { bumpMap: map, bumpScale: 3 });
        all.physical = compare(THREE.MeshPhysicalMaterial, { ...physical, clearcoatNormalMap: normalMap });
      }
      redirected.dispose();
      return all;
    }, flipY);
    for (const [name, { own, got }] of Object.entries(measured)) {
      // Between their vertices the UVs of the mesh are straight, and those of the map are not.
      assert.ok(got < 0.1 && got < own / 30, `${name}: ${own} -> ${got}, flipY ${flipY}`);
    }
  }
});

test("the mip level is right up to the borders of charts", options, async () => {
  const levels = await inPage(() => {
    // The maps of two charts, side by side on the surface, differ by .2 at the seam; each level has a grey of its own.
    const delta = Uint16Array.from({ length: 2 * 256 * 256 }, (_, k) => {
      const u = (((k >> 1) % 256) + 0.5) / 256;
      return THREE.DataUtils.toHalfFloat(k % 2 ? 0 : u < 0.5 ? 0.4 * u : 0.4 * u - 0.4);
    });
    const value = new THREE.DataTexture(delta, 256, 256, THREE.RGFormat, THREE.HalfFloatType);
    Object.assign(value, MIPMAPS, { minFilter: THREE.LinearFilter });
    const map = Object.assign(new THREE.DataTexture(), MIPMAPS);
    map.mipmaps = Array.from({ length: 9 }, (_, level) => {
      const width = 256 >> level;
      return { width, height: width, data: new Uint8Array(4 * width * width).fill(25 * level) };
    });
    map.image = map.mipmaps[0];
    const material = new THREE.MeshBasicMaterial({ map });
    patch(material, { map: { value }, strength: { value: 1 }, wipe: { value: 0 } });
    const meshes = [0, 1].map((side) => {
      const mesh = new THREE.Mesh(new THREE.PlaneGeometry(0.06, 0.06), material);
      // The gutters have 2.6 texels, and a pixel 4.4: beyond the seam a block of pixels is in the other chart.
      mesh.geometry.attributes.uv.array.forEach((t, k, uvs) => k % 2 || (uvs[k] = 0.5 * side + (t ? 0.49 : 0.01)));
      mesh.position.set(0.06 * side + 0.00878, 0.0003, 0);
      return mesh;
    });
    const data = picture(...meshes);
    // A unit has 470.6 pixels, and the seam is at column 300.6.
    return Array.from({ length: 400 }, (_, k) => data[4 * ((270 + Math.floor(k / 20)) * 800 + 290 + (k % 20))] / 25);
  });
  // Texels a pixel: in v 256 / (.06 * 470.6), in u .48 * 1.4 of that.
  const level = Math.log2(256 / (0.06 * 470.6));
  const [least, most] = [Math.min(...levels), Math.max(...levels)];
  assert.ok(most < level + 0.1 && least > level - 0.1, `levels ${least} to ${most}, not ${level}`);
});

test("the pose that is drawn, and its shadow, are those of the map, and the newest pose wins", options, async () => {
  const seen = await inPage(async () => {
    const wall = new THREE.Mesh(new THREE.PlaneGeometry(4, 4), new THREE.MeshStandardMaterial());
    wall.position.z = -0.3;
    wall.receiveShadow = sun.castShadow = renderer.shadowMap.enabled = true;
    const out = [];
    for (const skinned of [true, false]) {
      const material = new THREE.MeshStandardMaterial({ map: paint(true), side: THREE.DoubleSide });
      const { mesh, pose, redirected } = await stretched({ material, skinned });
      mesh.castShadow = true;
      const own = [mesh.skeleton, mesh.morphTargetInfluences];
      const bent = picture(mesh, wall);
      pose(0);
      const held = difference(bent, picture(mesh, wall)).most;
      mesh.position.y = 0.1;
      const carried = difference(bent.slice(47 * 3200), picture(mesh).slice(94 * 3200), 100, 700).mean < 1;
      mesh.position.y = 0;
      const isLive = own[0] === mesh.skeleton && own[1] === mesh.morphTargetInfluences;
      const updates = [1, 2, 3].map(() => redirected.update().then(Boolean));
      const solved = await Promise.all(updates);
      const rest = picture(mesh, wall);
      redirected.dispose();
      // A mesh at rest looks the same without redirection, and so does its shadow.
      const same = difference(rest, picture(mesh, wall)).most < 4;
      out.push({ isLive, solved, held, carried, moved: difference(bent, rest).mean > 3, same });
    }
    renderer.shadowMap.enabled = false;
    return out;
  });
  const expected = { isLive: true, solved: [true, false, true], held: 0, carried: true, moved: true, same: true };
  assert.deepEqual(seen, [expected, expected]);
});

test("a material's own shader, wipe, strength and dispose", options, async () => {
  const { aspects, ...seen } = await inPage(async () => {
    const material = new THREE.MeshStandardMaterial({ map: paint(true) });
    const own = (material.onBeforeCompile = (shader) => {
      const mapped = "#include <map_fragment>";
      shader.fragmentShader = shader.fragmentShader.replace(mapped, `${mapped}\ndiffuseColor.rgb = diffuseColor.brg;`);
    });
    const plain = strip({ material, skinned: true });
    plain.pose(1);
    const before = picture(plain.mesh);
    const { mesh, redirected } = await stretched({ material, skinned: true });
    const { strength, wipe } = redirected.uniforms;
    const after = picture(mesh);
    wipe.value = 400;
    const wiped = picture(mesh);
    const halves = [difference(wiped, before, 0, 400).most, difference(wiped, after, 400).most];
    wipe.value = strength.value = 0;
    const none = difference(picture(mesh), before).most;
    strength.value = 1;
    const again = difference(picture(mesh), after).most;
    redirected.dispose();
    const keys = [mesh, material].flatMap(Object.keys).filter((key) => /^on|^customProgram/.test(key));
    const isOwn = material.onBeforeCompile === own;
    const disposed = difference(picture(mesh), before).most;
    const counted = () => [renderer.info.memory, renderer.info.programs.length].map((of) => JSON.stringify(of)).join();
    const first = counted();
    const late = await redirected.update();
    const second = await redirect(mesh, { rigidity, size: SIZE, grid: 192 });
    await second.update("draft");
    const twice = difference(picture(mesh), after).most;
    second.dispose();
    picture(mesh);
    const left = first === counted() ? null : `${first} ${counted()}`;
    const aspects = ellipses(after, 1).map(({ aspect }) => aspect);
    return { aspects, halves, none, again, keys, isOwn, disposed, late, twice, left };
  });
  assert.ok(aspects.length === 9 && aspects.every((aspect) => aspect < 1.08), `${aspects}`);
  const same = { halves: [0, 0], none: 0, again: 0, disposed: 0, twice: 0 };
  assert.deepEqual(seen, { ...same, keys: ["onBeforeCompile"], isOwn: true, late: null, left: null });
});

test("the page of the example solves", options, async () => {
  // `npm run page` comes first.
  const { server, url } = await serve(fileURLToPath(new URL("../../../examples/web/dist", import.meta.url)));
  await page.goto(`${url}three.html`);
  await page.waitForSelector("[data-solved]");
  assert.deepEqual(problems, []);
  server.close();
});
