"""Bake for Games: maps and a mesh with morph targets, as an engine adds them up, beside the package's own results."""

import json
import os
from pathlib import Path
from unittest import mock

import numpy as np

from support import Arm, Case, bpy, load, part


class Basis(Case):
    def bake(self, poses, tiles=1, error=8):
        """An arm with two shape keys that move different studs, and what a bake writes of it: the document, and the
        glTF."""
        arm, self.folder = Arm.with_studs(tiles=tiles, along=24, around=16, size=64), self.scratch()
        rest = arm.rest()
        pinched = rest * np.where(abs(rest[:, :1] - 0.4) < 0.2, (1, 0.6, 1), 1)
        arm.object.shape_key_add(name="pinch").data.foreach_set("co", pinched.astype(np.float32).ravel())
        arm.object.location = arm.rig.location = (1, 2, 3)
        settings = self.bakes_to(self.folder, 1, 5)
        settings.poses, settings.error = poses, error
        bpy.context.scene.frame_set(2)
        self.assertEqual(bpy.ops.vrtm.bake_basis(), {"FINISHED"})
        self.assertEqual((bpy.context.scene.frame_current, part("session").baking), (2, False))
        return arm, json.loads(Path(self.folder, "arm.basis.json").read_bytes())

    def judge(self, arm, document, poses):
        """Sums of maps, and those of morph targets, are near the package's own results for these poses."""
        from vrtm.basis.gltf import read

        rows, near = np.array([row["weights"] for row in document["frames"]]), document["max_error"] / 4096
        maps = [[load(os.path.join(self.folder, name))[..., :2] for name in of["maps"]] for of in document["files"]]
        sums = np.tensordot(rows, np.concatenate(maps, 2), 1)
        file, values = read(Path(self.folder, "arm.basis.glb").read_bytes())
        weights = values(file["animations"][0]["samplers"][0]["output"]).reshape(len(rows), -1)
        parts, asset = file["meshes"][0]["primitives"], arm.asset()
        # Where the mesh's own corners are among the file's vertices, by their UVs at rest.
        for number, (pose, total) in enumerate(zip(poses, sums, strict=True)):
            asset.solve(pose)
            self.assertLess(np.linalg.norm(total - arm.delta(asset), axis=-1).max(), 1.001 * near)
            found = {}
            for of in parts:
                tile = int(file["materials"][of["material"]]["name"]) - 1001
                at, uvs = (
                    np.stack([values(one[kind]) for one in (of["attributes"], *of["targets"])])
                    for kind in ("POSITION", "TEXCOORD_0")
                )
                at, moved = (np.tensordot([1, *weights[number]], of, 1) for of in (at, uvs))
                for k in set(values(of["indices"]).astype(int).ravel()):
                    (x, z, y), (u, v), key = at[k], moved[k], np.round(uvs[0, k] * (1, -1) + (tile, 1), 4)
                    found[tuple(key)] = x, -y, z, u + tile, 1 - v
            expected = np.hstack([pose[arm.faces.ravel()] + (1, 2, 3), asset.corner_uvs()])
            off = np.array([found[tuple(np.round(uv.astype(float), 4))] for uv in arm.uvs]) - expected
            self.assertLess(np.abs(off[:, :3]).max(), 2e-3)
            self.assertLess(np.abs(off[:, 3:]).max(), near)
        return file["meshes"][0]["extras"]["targetNames"]

    def test_shape_keys_drive_maps_and_targets(self):
        arm, document = self.bake("KEYS")
        keys = arm.mesh.shape_keys.key_blocks[1:]
        poses = [np.array([point.co[:] for point in key.data], np.float32) for key in keys]
        names = ["swell", "pinch"]
        self.assertEqual(self.judge(arm, document, poses), names)
        self.assertEqual((document["maps"], document["driver"]["form"]), (2, "products"))
        self.assertEqual(document["driver"]["controls"], names)
        self.assertLess(document["error_of_pairs"], 2 * document["max_error"])
        # As another program reads it.
        bpy.ops.import_scene.gltf(filepath=os.path.join(self.folder, "arm.basis.glb"))
        other = bpy.context.object.data
        self.assertEqual((other.shape_keys.key_blocks.keys(), other.materials[0].name), (["Basis", *names], "1001"))

    def test_frames_of_two_tiles(self):
        arm, document = self.bake("FRAMES", tiles=2, error=64)
        poses = []
        for frame in range(1, 6):
            bpy.context.scene.frame_set(frame)
            poses.append(arm.pose())
        names = self.judge(arm, document, poses)
        self.assertLess(document["maps"], 5)
        self.assertEqual(names[: document["maps"]], [f"basis {k + 1}" for k in range(document["maps"])])
        self.assertIsNone(document["driver"])

    def test_what_is_wrong_is_said(self):
        arm, _ = self.bake("KEYS")
        bake, settings, before = bpy.ops.vrtm.bake_basis, bpy.context.scene.vrtm_bake, set(os.listdir(self.folder))
        # Its own files are replaced, and no others.
        Path(self.folder, "arm.basis.json").write_text("an artist's work")
        self.refused("arm.basis.json is there.*Overwrite", bake)
        settings.overwrite = True
        # What is written is looked at.
        save = part("basis").save
        with mock.patch.object(part("basis"), "save", lambda pixels, *of, **how: save(pixels + 0.01, *of, **how)):
            self.refused("1001.0000.exr is read back as something else.*; 2 poses were solved", bake)
        with mock.patch("vrtm.bake.basis_morphs.placed", lambda points, matrix: points):
            self.refused("arm.basis.glb is read back otherwise than was meant: swell: it reaches from", bake)
        arm.object.vrtm.rest_source = "SHAPE_KEY"
        self.refused("arm: shape keys begin at the mesh itself: set Rest to Mesh, or Poses to Frames", bake)
        arm.object.vrtm.rest_source = "MESH"
        arm.object.shape_key_clear()
        self.refused("arm has no shape key that moves it: set Poses to Frames", bake)
        self.assertEqual(set(os.listdir(self.folder)), before)
