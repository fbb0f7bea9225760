// Meshes of three.js as meshes of vrtm, in Node: poses are those of three.js, and vertices split at seams are one.
import assert from "node:assert/strict";
import { test } from "node:test";
import {
  Bone, BoxGeometry, BufferAttribute, BufferGeometry, CylinderGeometry, Group, InterleavedBuffer,
  InterleavedBufferAttribute, Matrix4, Mesh, MeshStandardMaterial, Scene, Skeleton, SkinnedMesh, Texture, Vector3,
} from "three";
import { Source } from "../dist/three/geometry.js";

let seed = 1;
const random = () => ((seed = (seed * 48271) % 0x7fffffff) / 0x7fffffff) * 2 - 1;
const floats = (count, of = random) => Float32Array.from({ length: count }, of);

/** Places an object anyhow. */
function place(object) {
  object.position.set(random(), random(), random());
  object.quaternion.set(random(), random(), random(), random()).normalize();
  object.scale.set(1.2, 0.7, -0.9).addScalar(0.1 * random());
  return object;
}

/** A mesh with five bones, three morph targets and weights that are 8 bits, so that their sum is not quite 1. */
function creature(relative, interleaved) {
  const geometry = new CylinderGeometry(1, 0.6, 3, 9, 7);
  const { count } = geometry.attributes.position;
  geometry.morphAttributes.position = [0, 1, 2].map(() => new BufferAttribute(floats(3 * count), 3));
  geometry.morphTargetsRelative = relative;
  const bonesOf = Uint8Array.from({ length: 4 * count }, () => 2.5 + 2.4 * random());
  geometry.setAttribute("skinIndex", new BufferAttribute(bonesOf, 4));
  const weights = new Uint8Array(4 * count).map(() => 60 + 20 * random());
  geometry.setAttribute("skinWeight", new BufferAttribute(weights, 4, true));
  if (interleaved) {
    const { position, uv } = geometry.attributes;
    const buffer = new InterleavedBuffer(floats(8 * count, (_, k) =>
      k % 8 < 3 ? position.getComponent(k >> 3, k % 8) : k % 8 > 5 ? uv.getComponent(k >> 3, (k % 8) - 6) : 0), 8);
    geometry.setAttribute("position", new InterleavedBufferAttribute(buffer, 3, 0));
    geometry.setAttribute("uv", new InterleavedBufferAttribute(buffer, 2, 6));
  }
  const mesh = new SkinnedMesh(geometry, new MeshStandardMaterial());
  const bones = Array.from({ length: 5 }, () => place(new Bone()));
  bones.forEach((bone, k) => k > 0 && bones[k - 1].add(bone));
  const root = place(new Group()).add(mesh, bones[0]);
  new Scene().add(root);
  root.parent.updateMatrixWorld();
  mesh.bind(new Skeleton(bones), place(new Bone()).matrix.clone());
  return { mesh, bones };
}

for (const [relative, interleaved] of [[true, false], [false, true]]) {
  test(`skins and ${relative ? "relative" : "absolute"} morph targets are those of three.js`, () => {
    const { mesh, bones } = creature(relative, interleaved);
    const source = new Source([mesh]);
    bones.forEach(place);
    mesh.morphTargetInfluences = [0.4, 0, -0.8];
    const pose = source.pose();
    const size = Math.max(...pose) - Math.min(...pose);
    source.vertexOf[0].forEach((n, v) => {
      const expected = mesh.getVertexPosition(v, new Vector3()).toArray();
      expected.forEach((x, k) => assert.ok(Math.abs(x - pose[3 * n + k]) < 1e-6 * size, `${v}: ${x}`));
    });
    // The space stays that of the first mesh when the whole scene moves, and is told.
    mesh.geometry.setAttribute("skinWeight", new BufferAttribute(new Float32Array(8 * pose.length).fill(0.25), 4));
    const whole = new Source([mesh]);
    const before = whole.pose();
    place(mesh.parent.parent);
    const again = whole.pose();
    again.forEach((x, k) => assert.ok(Math.abs(x - before[k]) < 1e-5 * size));
    const n = whole.vertexOf[0][5];
    const world = new Vector3(...again.subarray(3 * n, 3 * n + 3)).applyMatrix4(whole.matrixWorld);
    assert.ok(world.distanceTo(mesh.getVertexPosition(5, new Vector3()).applyMatrix4(mesh.matrixWorld)) < 1e-4);
  });
}

test("at rest a skin has the size that its bones give it, whatever they do", () => {
  const geometry = new BoxGeometry(100, 100, 100);
  const { count } = geometry.attributes.position;
  geometry.setAttribute("skinIndex", new BufferAttribute(new Uint16Array(4 * count), 4));
  geometry.setAttribute("skinWeight", new BufferAttribute(floats(4 * count, (_, k) => (k % 4 === 0 ? 1 : 0)), 4));
  const mesh = new SkinnedMesh(geometry, new MeshStandardMaterial());
  const bone = new Bone();
  bone.rotation.x = 1;
  const armature = new Group().add(bone);
  armature.scale.setScalar(0.01);
  new Group().add(mesh, armature);
  mesh.bind(new Skeleton([bone], [new Matrix4()]), new Matrix4());
  const { mesh: { positions } } = new Source([mesh]);
  const edge = Math.hypot(...[0, 1, 2].map((k) => positions[k] - positions[3 + k]));
  assert.ok(Math.abs(edge - 1) < 1e-5 || Math.abs(edge - Math.SQRT2) < 1e-5, `${edge}`);
  assert.equal(positions.length, 3 * 8, "the corners of a box are welded");
});

test("vertices are welded that coincide and move alike", () => {
  const geometry = new BoxGeometry();
  geometry.morphAttributes.position = [new BufferAttribute(new Float32Array(3 * 24), 3)];
  geometry.morphTargetsRelative = true;
  const count = () => new Source([new Mesh(geometry)]).mesh.positions.length / 3;
  assert.equal(count(), 8);
  geometry.morphAttributes.position[0].setX(0, 0.1);
  assert.equal(count(), 9);
  // Other meshes move apart; those of one skeleton do not.
  assert.equal(new Source([new Mesh(new BoxGeometry()), new Mesh(new BoxGeometry())]).mesh.positions.length / 3, 16);
  const { mesh } = creature(true, false);
  mesh.geometry.morphAttributes = {};
  const twin = new SkinnedMesh(mesh.geometry.clone(), mesh.material);
  mesh.parent.add(twin);
  twin.bind(mesh.skeleton, mesh.bindMatrix);
  const [one, both] = [[mesh], [mesh, twin]].map((meshes) => new Source(meshes));
  assert.equal(both.mesh.positions.length, one.mesh.positions.length);
  assert.equal(both.mesh.indices.length, 2 * one.mesh.indices.length);
});

test("charts are in the first tile, with the image's first row at v = 1", () => {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(floats(27), 3));
  // A triangle in the tile, one two tiles left and one up, and one that is larger than a tile, by its own middle.
  const given = [0, 0, 1, 0, 0, 1, -1.9, 1.1, -1.1, 1.1, -1.9, 1.9, 1.2, 0, 2.9, 0, 1.2, 1];
  geometry.setAttribute("uv1", new BufferAttribute(Float32Array.from(given), 2));
  const uvs = (map) => {
    const { mesh } = new Source([new Mesh(geometry, new MeshStandardMaterial({ map }))], { uv: 1 });
    return [...mesh.uvIndices].flatMap((n) => [...mesh.uvs.subarray(2 * n, 2 * n + 2)]);
  };
  const close = (values, expected) =>
    values.forEach((x, k) => assert.ok(Math.abs(x - expected[k]) < 1e-6, `${values}`));
  const texture = new Texture();
  close(uvs(texture), [0, 0, 1, 0, 0, 1, 0.1, 0.1, 0.9, 0.1, 0.1, 0.9, 0.2, 0, 1.9, 0, 0.2, 1]);
  texture.flipY = false;
  close(uvs(texture), [0, 1, 1, 1, 0, 0, 0.1, 0.9, 0.9, 0.9, 0.1, 0.1, 0.2, 1, 1.9, 1, 0.2, 0]);
  assert.throws(() => new Source([new Mesh(geometry)]), /has no UVs \(uv\)/);
});
