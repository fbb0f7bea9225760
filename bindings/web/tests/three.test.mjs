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
    await page.waitForFunction("window.difference");
  }
});
after(async () => {
  await browser?.close();
  served?.server.close();
});

test("studs on skinned and on morphing meshes stay round, and rays find their paint", options, async () => {
  for (const skinned of [true, false]) {
    const { own, got, found } = await page.evaluate(async (skinned) => {
      const material = new THREE.MeshStandardMaterial({ map: paint(true), roughness: 1 });
      const { mesh, pose, redirected } = await stretched({ material, skinned }, {}, "normal");
      const after = aspects(picture(mesh));
      const ray = new THREE.Raycaster();
      mesh.updateWorldMatrix(true, true);
      const found = after.map(({ at }) => {
        ray.setFromCamera(at, camera);
        const uv = redirected.uvAt(ray.intersectObject(mesh)[0].uv).subScalar(0.5);
        return Math.min(...STUDS.map(([x, y]) => Math.hypot(uv.x - x, uv.y - y)));
      });
      redirected.dispose();
      return { own: aspects(picture(mesh)), got: after, found };
    }, skinned);
    assert.equal(own.length, 9);
    assert.equal(got.length, 9);
    for (const [k, { aspect, area }] of got.entries()) {
      assert.ok(Math.abs(own[k].aspect - 1.6) < 0.02, `own UVs: ${own[k].aspect}`);
      // A pixel more or less on a diameter of 56 is .018.
      assert.ok(aspect < 1.05, `redirected: ${aspect}`);
      // A stud at rest has the radius .06 of a strip with a side of 470.6 pixels.
      assert.ok(Math.abs(area / (Math.PI * (0.06 * 470.6) ** 2) - 1) < 0.03, `${area} pixels`);
      assert.ok(found[k] < 0.002, `${found[k]} from the middle of a stud`);
    }
  }
  assert.deepEqual(problems, []);
});

test("each texture, its transform and its tangents are those of a mesh with redirected UVs", options, async () => {
  for (const flipY of [true, false]) {
    const measured = await page.evaluate(async (flipY) => {
      const { redirected } = await stretched({ material: new THREE.MeshStandardMaterial({ map: paint(flipY) }), flipY, shear: 0.5 });
      const [map, normalMap] = [paint(flipY), relief(flipY)];
      const turned = Object.assign(relief(flipY), { rotation: 0.4 });
      turned.repeat.set(1.5, 0.8);
      turned.offset.set(0.1, 0.2);
      const physical = { clearcoat: 1, sheen: 1, sheenColor: 0xffffff, transmission: 0.3, iridescence: 1, emissive: 0x404040, metalness: 1 };
      for (const name of ["roughness", "metalness", "sheenColor", "iridescence", "specularColor", "transmission", "thickness", "emissive", "alpha"]) {
        physical[`${name}Map`] = map;
      }
      const variants = {
        map: [THREE.MeshStandardMaterial, { map }],
        turned: [THREE.MeshStandardMaterial, { normalMap: turned, roughness: 0.5 }],
        normal: [THREE.MeshStandardMaterial, { normalMap, roughness: 0.5 }],
        tangents: [THREE.MeshStandardMaterial, { normalMap, roughness: 0.5 }],
        bump: [THREE.MeshStandardMaterial, { bumpMap: map, bumpScale: 3 }],
        physical: [THREE.MeshPhysicalMaterial, { ...physical, clearcoatNormalMap: normalMap }],
        unlit: [THREE.MeshBasicMaterial, { map }],
      };
      const fine = exact(strip({ flipY, shear: 0.5, count: 250 }), redirected, flipY, 0.5);
      const out = {};
      for (const [name, [Material, values]] of Object.entries(variants)) {
        const material = new Material(values);
        const { mesh, pose } = strip({ material, flipY, shear: 0.5 });
        if (name === "tangents") {
          [mesh.geometry, fine].forEach((geometry) => geometry.computeTangents());
        }
        pose(1);
        const want = picture(new THREE.Mesh(fine, material));
        fine.deleteAttribute("tangent");
        const own = difference(picture(mesh), want);
        const undo = patch(material, redirected.uniforms, { flipY });
        out[name] = { own, got: difference(picture(mesh), want) };
        undo();
      }
      redirected.dispose();
      return out;
    }, flipY);
    for (const [name, { own, got }] of Object.entries(measured)) {
      // Between their vertices the UVs of the mesh are straight, and those of the map are not.
      assert.ok(got.mean < 0.1 && got.mean < own.mean / 30, `${name}: ${JSON.stringify({ flipY, own, got })}`);
    }
  }
  assert.deepEqual(problems, []);
});

test("the mip level is right up to the borders of charts", options, async () => {
  const { most, least } = await page.evaluate(() => {
    // Two charts, side by side on the surface, whose maps differ by .2 at the seam; each level has a grey of its own.
    const half = (x) => THREE.DataUtils.toHalfFloat(x);
    const delta = Uint16Array.from({ length: 2 * 128 * 128 }, (_, k) => {
      const u = ((k >> 1) % 128 + 0.5) / 128;
      return half(k % 2 ? 0 : u < 0.5 ? 0.1 + 0.4 * (u - 0.25) : 0.4 * (u - 0.75) - 0.1);
    });
    const value = new THREE.DataTexture(delta, 128, 128, THREE.RGFormat, THREE.HalfFloatType);
    Object.assign(value, { magFilter: THREE.LinearFilter, minFilter: THREE.LinearFilter, needsUpdate: true });
    const map = new THREE.DataTexture();
    map.mipmaps = Array.from({ length: 9 }, (_, level) => {
      const width = 256 >> level;
      return { width, height: width, data: new Uint8Array(4 * width * width).fill(25 * level) };
    });
    Object.assign(map, { image: map.mipmaps[0], minFilter: THREE.LinearMipmapLinearFilter, magFilter: THREE.LinearFilter, needsUpdate: true });
    const material = new THREE.MeshBasicMaterial({ map });
    patch(material, { map: { value }, strength: { value: 1 }, wipe: { value: 0 } });
    const geometry = new THREE.PlaneGeometry(0.08, 0.08);
    // The charts have gutters of 2.6 texels.
    geometry.attributes.uv.array.forEach((t, k, array) => k % 2 || (array[k] = t ? 0.48 : 0.02));
    const right = geometry.clone();
    right.attributes.uv.array.forEach((t, k, array) => k % 2 || (array[k] = t + 0.5));
    const meshes = [geometry, right].map((each, k) => Object.assign(new THREE.Mesh(each, material), { name: k }));
    meshes.forEach((mesh, k) => mesh.position.set(0.08 * k + 0.0003, 0.0003, 0));
    const { data, width } = picture(...meshes);
    const levels = [];
    // The seam is .04 from the middle of the first mesh; the picture has 470.6 pixels a unit.
    const [x, y] = [(0.64 + 0.0003) * 470.6, 560 / 2].map(Math.round);
    for (let j = y - 15; j < y + 15; j++) {
      for (let i = x - 15; i < x + 15; i++) {
        levels.push(data[4 * (j * width + i)] / 25);
      }
    }
    return { most: Math.max(...levels), least: Math.min(...levels) };
  });
  // Texels a pixel: 256 * .46 / (.08 * 470.6) in u, times 1.4 by the map, and 256 / (.08 * 470.6) in v.
  const level = Math.log2(256 / (0.08 * 470.6));
  assert.ok(most < level + 0.1 && least > level - 0.1, `levels ${least} to ${most}, not ${level}`);
  assert.deepEqual(problems, []);
});

test("the pose that is drawn, and its shadow, are those of the map, and the newest pose wins", options, async () => {
  const seen = await page.evaluate(async () => {
    const wall = new THREE.Mesh(new THREE.PlaneGeometry(4, 4), new THREE.MeshStandardMaterial());
    wall.position.z = -0.3;
    wall.receiveShadow = sun.castShadow = renderer.shadowMap.enabled = true;
    const out = [];
    for (const skinned of [true, false]) {
      const material = new THREE.MeshStandardMaterial({ map: paint(true) });
      const { mesh, pose, redirected } = await stretched({ material, skinned });
      mesh.castShadow = true;
      const [skeleton, influences] = [mesh.skeleton, mesh.morphTargetInfluences];
      const bent = picture(mesh, wall);
      pose(0);
      const held = picture(mesh, wall);
      const isLive = mesh.skeleton === skeleton && mesh.morphTargetInfluences === influences;
      const updates = [redirected.update(), redirected.update(), redirected.update()].map((update) => update.then(Boolean));
      const solved = await Promise.all(updates);
      const rest = picture(mesh, wall);
      redirected.uniforms.strength.value = 0;
      out.push({ isLive, solved, held: difference(bent, held).most, moved: difference(bent, rest).mean });
      redirected.dispose();
      // Without redirection a mesh at rest looks the same, and so does its shadow.
      out.at(-1).rest = difference(rest, picture(mesh, wall)).most;
    }
    renderer.shadowMap.enabled = false;
    return out;
  });
  for (const { isLive, solved, held, moved, rest } of seen) {
    assert.deepEqual({ isLive, solved, held }, { isLive: true, solved: [true, false, true], held: 0 });
    assert.ok(moved > 3 && rest < 4, `${moved}, ${rest}`);
  }
  assert.deepEqual(problems, []);
});

test("a material's own shader, wipe, strength, a lost context and dispose", options, async () => {
  const seen = await page.evaluate(async () => {
    const material = new THREE.MeshStandardMaterial({ map: paint(true) });
    const own = (shader) => {
      shader.fragmentShader = shader.fragmentShader.replace("#include <map_fragment>", "$&\ndiffuseColor.rgb = diffuseColor.brg;");
    };
    material.onBeforeCompile = own;
    const made = strip({ material, skinned: true });
    made.pose(1);
    const before = picture(made.mesh);
    made.pose(0);
    const { mesh, pose, redirected } = await stretched({ material, skinned: true });
    const { strength, wipe } = redirected.uniforms;
    const after = picture(mesh);
    const green = aspects({ ...after, data: after.data.slice(1) }).map(({ aspect }) => aspect);
    wipe.value = 400;
    const wiped = picture(mesh);
    const half = (from, a) => ({ data: a.data.filter((_, k) => (k >> 2) % a.width >= from && (k >> 2) % a.width < from + 400) });
    const halves = [difference(half(0, wiped), half(0, before)).most, difference(half(400, wiped), half(400, after)).most];
    Object.assign(wipe, { value: 0 });
    strength.value = 0;
    const none = difference(picture(mesh), before).most;
    strength.value = 1;
    const { domElement } = renderer;
    const told = (name) => new Promise((resolve) => domElement.addEventListener(name, resolve, { once: true }));
    const lost = told("webglcontextlost");
    renderer.forceContextLoss();
    await lost;
    // The browser restores none while it still tells that it is lost.
    await new Promise((resolve) => setTimeout(resolve));
    const restored = told("webglcontextrestored");
    renderer.forceContextRestore();
    await restored;
    const again = difference(picture(mesh), after).most;
    redirected.dispose();
    const keys = [mesh, material].flatMap((object) => Object.keys(object).filter((key) => /^on|^customProgram/.test(key)));
    const late = await redirected.update();
    return { green, halves, none, again, keys, late, isOwn: material.onBeforeCompile === own, disposed: difference(picture(mesh), before).most };
  });
  assert.ok(seen.green.length === 9 && seen.green.every((aspect) => aspect < 1.08), `${seen.green}`);
  assert.deepEqual({ ...seen, green: 0 }, {
    green: 0, halves: [0, 0], none: 0, again: 0, keys: ["onBeforeCompile"], late: null, isOwn: true, disposed: 0,
  });
  problems.splice(0).forEach((problem) => assert.match(problem, /context/i));
});

test("a hundred redirections leave nothing behind", options, async () => {
  const counted = await page.evaluate(async () => {
    const material = new THREE.MeshBasicMaterial({ map: paint(true) });
    const { mesh, pose } = strip({ material, skinned: true });
    const counts = [];
    for (let k = 0; k < 100; k++) {
      const redirected = await redirect(mesh, { rigidity: new Uint8Array(64).fill(255), size: 8, mapSize: 32 });
      pose(k % 2);
      await redirected.update("draft");
      picture(mesh);
      redirected.dispose();
      picture(mesh);
      const { geometries, textures } = renderer.info.memory;
      counts.push([geometries, textures, renderer.info.programs.length]);
    }
    return [counts[0], counts.at(-1)];
  });
  assert.deepEqual(counted[1], counted[0]);
  assert.equal(page.workers().length, 0);
  assert.deepEqual(problems, []);
});
