"""Bakes for game engines: a few maps whose weighted sums stand for the redirections of all poses, and a mesh whose UVs
morph with its shape. The poses are frames, or shape keys, each at its full value."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np

from . import geometry, maps, result_image, session, solve, states
from .bake import FrameBake, check_free, check_name, file_name, folder_of, part_of, save
from .messages import Problem

if TYPE_CHECKING:
    import vrtm
    from vrtm.basis.fit import Basis

# Texels of the texture that errors are told in, and pairs of shape keys that the sums are tried on.
TEXTURE, PAIRS = 4096, 8


@dataclass
class Taken:
    """The poses of an object by their names, and the difference of UVs in each, (texels of all tiles, 2)."""

    keys: dict[str, np.ndarray]
    matrix: np.ndarray  # by which rows of positions are multiplied to lie in the world
    poses: dict[str, np.ndarray] = field(default_factory=dict)
    deltas: list[np.ndarray] = field(default_factory=list)


def shapes_of(obj: bpy.types.Object) -> dict[str, np.ndarray]:
    """The poses in which each shape key acts alone, by their names. Raises a Problem."""
    keys, found = obj.data.shape_keys, {}
    if obj.vrtm.rest_source != "MESH":
        raise Problem(f"{obj.name}: shape keys begin at the mesh itself: set Rest to Mesh, or Poses to Frames")
    for key in keys.key_blocks[1:] if keys is not None and keys.use_relative else ():
        moved = geometry.read(key.data, "co", 3) - geometry.read(key.relative_key.data, "co", 3)
        if key.vertex_group:
            moved *= maps.group_values(obj, key.vertex_group)[:, None]
        if moved.any() and not key.mute:
            found[key.name] = geometry.positions(obj.data) + moved
    if not found:
        raise Problem(f"{obj.name} has no shape key that moves it: set Poses to Frames")
    return found


class Bake(FrameBake):
    """The baking of some objects for games."""

    def __init__(self, scene: bpy.types.Scene, objects: list[bpy.types.Object]) -> None:
        settings, self.folder, self.told = scene.vrtm_bake, folder_of(scene), []
        super().__init__(scene, objects)
        self.by_keys, self.bound = settings.poses == "KEYS", settings.error / TEXTURE
        self.taken = {
            obj.name: Taken(shapes_of(obj) if self.by_keys else {}, np.array(obj.matrix_world).T) for obj in objects
        }
        self.seconds = np.array(self.frames) * scene.render.fps_base / scene.render.fps
        if self.by_keys:
            # One pose a step, all at the present frame.
            self.frames = [self.kept] * max(len(taken.keys) for taken in self.taken.values())

    def _files(self, obj: bpy.types.Object, asset: vrtm.Asset, number: int) -> list[list[Path]]:
        """The files of a number of maps, of each tile."""
        return [
            [self.folder / file_name(obj, part_of(tile.udim, tile.layer), k, "basis") for k in range(number)]
            for tile in asset.tiles
        ]

    def _path(self, obj: bpy.types.Object, ending: str) -> Path:
        return self.folder / f"{bpy.path.clean_name(obj.name)}.basis.{ending}"

    def _asset(self, obj: bpy.types.Object) -> vrtm.Asset:
        solve.prepare(obj, states.state_of(obj))
        return states.state_of(obj).prepared.asset

    def begin(self) -> None:
        outputs = []
        for obj in self.objects():
            check_name(obj)
            paths = [path for of in self._files(obj, self._asset(obj), len(self.frames)) for path in of]
            paths += [self._path(obj, ending) for ending in ("json", "glb")]
            outputs += [(str(path), obj.name) for path in paths]
        check_free(outputs, self.overwrite)

    def bake(self, obj: bpy.types.Object, pose: np.ndarray, frame: int) -> list[Path]:
        taken = self.taken[obj.name]
        name = next((name for name in taken.keys if name not in taken.poses), None)
        if self.by_keys and name is None:
            return []
        pose = taken.keys[name] if self.by_keys else pose
        taken.poses[name or f"frame {frame}"] = pose
        taken.deltas.append(self._solved(obj, pose))
        return []

    def _solved(self, obj: bpy.types.Object, pose: np.ndarray) -> np.ndarray:
        asset = self._asset(obj)
        asset.solve(pose, **solve.options_of(obj))
        size = result_image.layout_of(asset, obj.name, solve.level_of(obj)[2]).size
        images = [tile.fetch("redirection_delta", (size, size), channels=2) for tile in asset.tiles]
        return np.concatenate([image.reshape(-1, 2) for image in images])

    def finish(self) -> None:
        for obj in self.objects():
            self.told.append(self._fit(obj, self.taken[obj.name]))

    def _fit(self, obj: bpy.types.Object, taken: Taken) -> str:
        """Writes an object's maps and mesh, and reads them back. Returns a sentence. Raises a Problem."""
        fit, folds = session.library("vrtm.basis.fit"), session.library("vrtm.basis.folds").folds
        asset, names, deltas = self._asset(obj), list(taken.poses), np.stack(taken.deltas)
        size = int((deltas.shape[1] / len(asset.tiles)) ** 0.5)

        def folding(delta: np.ndarray) -> int:
            return sum(folds(image)[0] for image in delta.reshape(-1, size, size, 2))

        def is_whole(basis: Basis) -> bool:
            """False if the sum of a pose folds where the pose's own map does not."""
            return all(folding(fit.summed(basis.maps, row[None])[0]) <= own for row, own in zip(basis.weights, allowed))

        allowed = [folding(delta) for delta in deltas]
        basis = fit.fit(deltas, self.bound, is_whole)
        if basis is None:
            raise Problem(f"{obj.name}: no maps are as near as {self.bound * TEXTURE:g} texels: raise Largest Error")
        driver, weights, targets = None, basis.weights, [f"basis {k + 1}" for k in range(len(basis))]
        if self.by_keys:
            weights, targets = np.eye(len(names)), names
            driver = session.library("vrtm.basis.controls").drive(tuple(names), weights, basis.weights)
        of_pairs = self._of_pairs(obj, taken, basis) * TEXTURE if self.by_keys else None
        mesh = self._write_mesh(obj, taken, asset, targets, weights)
        rows = zip(names, basis.weights.tolist(), (basis.errors * TEXTURE).tolist())
        # As `vrtm bake` has it.
        document = {
            "program": {"name": "vrtm bake", "version": session.library().version()},
            "mesh": obj.name,
            "maps": len(basis),
            "max_error": self.bound * TEXTURE,
            "error_of_pairs": of_pairs,
            "texture_size": TEXTURE,
            "format": "half",
            "ranges": [{"offset": of.offset.tolist(), "scale": of.scale.tolist()} for of in basis.ranges],
            "driver": None if driver is None else driver.document(),
            "frames": [{"frame": name, "weights": row, "error": error} for name, row, error in rows],
            "files": self._write_maps(obj, asset, basis.maps.reshape(-1, len(asset.tiles), size, size, 2)),
            "gltf": mesh,
        }
        text = json.dumps(document, indent=1) + "\n"
        session.library("vrtm.bake.staging").write_bytes(str(self._path(obj, "json")), text.encode())
        off = f"{basis.errors.max() * TEXTURE:.1f} texels of {TEXTURE}"
        off += "" if of_pairs is None else f", by {of_pairs:.1f} where two shape keys act together"
        told = f"{obj.name}: {len(basis)} in place of {len(names)} maps, off by {off}; {self._path(obj, 'glb').name}"
        return f"{told} has {len(mesh['targets'])} morph targets; all were read back"

    def _of_pairs(self, obj: bpy.types.Object, taken: Taken, basis: Basis) -> float:
        """The largest error of sums where two shape keys act together, in UV."""
        chosen, rest = np.random.default_rng(1), geometry.positions(obj.data)
        most, moved = 0.0, [pose - rest for pose in taken.poses.values()]
        for _ in range(PAIRS if len(moved) > 1 else 0):
            one, other = chosen.choice(len(moved), 2, replace=False)
            own = self._solved(obj, rest + moved[one] + moved[other])
            total = session.library("vrtm.basis.fit").summed(basis.maps, basis.weights[[one, other]]).sum(axis=0)
            most = max(most, float(np.linalg.norm(total - own, axis=-1).max()))
        return most

    def _write_maps(self, obj: bpy.types.Object, asset: vrtm.Asset, images: np.ndarray) -> list[dict]:
        """Writes maps, (maps, tiles, height, width, 2), and reads them back."""
        files, size = self._files(obj, asset, len(images)), [*images.shape[2:4]]
        for tile, paths, of_tile in zip(asset.tiles, files, images.swapaxes(0, 1)):
            for number, (path, image) in enumerate(zip(paths, of_tile)):
                pixels = np.pad(image[::-1].astype(np.float32), ((0, 0), (0, 0), (0, 2)))
                pixels[..., 3] = 1
                facts = {"vrtm:form": "delta", "vrtm:udim": tile.udim, "vrtm:layer": tile.layer}
                save(pixels, path, obj, "basis", number, facts, halves=True)
                if not np.array_equal(maps.of_file(str(path)), pixels):
                    raise Problem(f"{path} is read back as something else than was written")
        return [
            {"udim": tile.udim, "layer": tile.layer, "size": size, "maps": [path.name for path in paths]}
            for tile, paths in zip(asset.tiles, files)
        ]

    def _write_mesh(
        self, obj: bpy.types.Object, taken: Taken, asset: vrtm.Asset, targets: list[str], weights: np.ndarray
    ) -> dict:
        """Writes the mesh with its morph targets, and reads it back. Returns figures."""
        morphs, differences = (session.library(f"vrtm.bake.basis_{name}") for name in ("morphs", "differences"))
        axes, of, poses = session.library("vrtm.bake.scene.axes"), geometry.topology(obj), list(taken.poses.values())
        shape = session.library("vrtm.bake.scene").Shape(
            bpy.path.clean_name(obj.name),
            obj.name,
            geometry.rest_positions(obj),
            of.face_counts.astype(np.int32),
            of.corner_vertices.astype(np.int32),
            of.uvs,
            np.arange(len(of.uvs), dtype=np.int32),
            "",
        )
        names = list(taken.poses)
        found = morphs.of_poses(
            shape, asset, poses, lambda k: self._solved(obj, poses[k]), names, targets, weights, self.bound, TEXTURE
        )
        path, matrix = str(self._path(obj, "glb")), taken.matrix @ axes.Axes("Z", 1.0).to(axes.GLTF)
        seconds = self.seconds if not self.by_keys else np.arange(len(poses)) / 24
        session.library("vrtm.bake.staging").write_bytes(path, found.glb(seconds, matrix))
        corners = of.triangles[:, ::-1] if np.linalg.det(taken.matrix[:3, :3]) < 0 else of.triangles
        meant = {}
        for number, (name, pose) in enumerate(taken.poses.items()):
            world = axes.placed(pose.astype(np.float64), taken.matrix)[:, [0, 2, 1]] * (1, 1, -1)
            meant[number] = name, differences.Surface(world[of.corner_vertices[corners]], of.uvs[corners])
        for what in differences.of_gltf(path, seconds, meant):
            raise Problem(f"{path} is read back otherwise than was meant: {what}")
        return found.figures
