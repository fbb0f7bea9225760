"""A scene of the bench: the folder of an asset, solved in poses of its own rig."""

import json
from pathlib import Path

import numpy as np
import vrtm
from PIL import Image
from vrtm.bake.basis_tiles import fans
from vrtm.bake.scene import Scene as File
from vrtm.basis.folds import folds
from vrtm.basis.strain import Ruler, Strain


class Scene:
    """A mesh with its tiles; all texels of these are one array."""

    def __init__(self, folder: Path, size: int) -> None:
        facts = json.loads((folder / "asset.json").read_text())
        self.name, self.size = facts["name"], size
        with File(str(folder / "rest.obj")) as file:
            (shape,) = file.shapes
        self.rest = shape.rest.astype(float)
        frames = np.fromfile(folder / "frames.f32", "<f4")
        self.shapes = frames.reshape(-1, len(self.rest), 3).astype(float) - self.rest
        self.asset = vrtm.Asset(
            vrtm.Device("cpu"),
            shape.rest,
            shape.indices,
            face_counts=shape.face_counts,
            uvs=shape.uvs,
            uv_indices=shape.uv_indices,
        )
        corners = fans(shape.face_counts)
        self.tiles, self.rulers, features = [], [], []
        for udim, name in facts["rigidity"].items():
            tile, place = self.asset.tile(int(udim)), np.array([(int(udim) - 1001) % 10, (int(udim) - 1001) // 10])
            image = Image.open(folder / name).convert("L")
            tile.set_rigidity(np.asarray(image))
            tile.set_settings(grid_width=size, grid_height=size)
            uvs = shape.uvs[shape.uv_indices[corners]].astype(float)
            inside = (np.floor(uvs.mean(axis=1)) == place).all(axis=1)
            vertices = shape.indices[corners[inside]]
            pairs = np.stack([vertices, shape.uv_indices[corners[inside]]], -1).reshape(-1, 2)
            numbers = np.unique(pairs, axis=0, return_inverse=True)[1].reshape(-1, 3)
            rigid = np.asarray(image.resize((size, size), Image.Resampling.BOX)) / 255
            self.rulers.append(Ruler(uvs[inside] - place, numbers, vertices, rigid))
            features.append(_features(rigid > 0.5))
            self.tiles.append(tile)
        at = (np.arange(size) + 0.5) / size
        x, y = np.meshgrid(at, at[::-1])
        self.at = np.concatenate([np.stack([x + 2 * k, y], -1).reshape(-1, 2) for k in range(len(self.tiles))])
        start = np.cumsum([0] + [found.max() + 1 for found in features])
        self.features = np.concatenate([np.where(f >= 0, f + s, -1).ravel() for f, s in zip(features, start)])

    def pose(self, controls: np.ndarray) -> np.ndarray:
        """The rest, and the folder's frames as blend shapes."""
        return self.rest + np.tensordot(controls, self.shapes, 1)

    def solve(self, controls: np.ndarray) -> np.ndarray:
        """(texels, 2): the delta of a pose."""
        fetches = [vrtm.Fetch(tile, "redirection_delta", self.size) for tile in self.tiles]
        return np.concatenate([d[..., :2].reshape(-1, 2) for d in self.asset.redirect(self.pose(controls), fetches)])

    def images(self, delta: np.ndarray) -> np.ndarray:
        return delta.reshape(len(self.tiles), self.size, self.size, 2)

    def strain(self, controls: np.ndarray, delta: np.ndarray) -> float:
        """RMS."""
        pose = self.pose(controls)
        found = [ruler.strains(image, self.rest, pose) for ruler, image in zip(self.rulers, self.images(delta))]
        return Strain.of(np.concatenate([values for values, _ in found])).rms

    def folds(self, delta: np.ndarray) -> int:
        return sum(folds(image)[0] for image in self.images(delta))


def _features(rigid: np.ndarray) -> np.ndarray:
    """(height, width): a number per connected set of texels, -1 elsewhere."""
    number = np.where(rigid, np.arange(rigid.size).reshape(rigid.shape), -1)
    while True:
        before = number.copy()
        for axis in (0, 1):
            for way in (1, -1):
                near = np.roll(number, way, axis)
                edge = [slice(None)] * 2
                edge[axis] = 0 if way == 1 else -1
                near[tuple(edge)] = -1
                number = np.where(rigid, np.maximum(number, near), -1)
        # Along the way of what was found so far.
        number = np.where(rigid, number.ravel()[np.maximum(number, 0)], -1)
        if (number == before).all():
            break
    found = np.full(rigid.shape, -1)
    found[rigid] = np.unique(number[rigid], return_inverse=True)[1]
    return found
