"""A scene of the bench, solved in poses of its own rig: the folder of an asset, or a skinned character of glTF."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import vrtm
from PIL import Image
from rig import Rig
from scipy.ndimage import label
from vrtm.bake.basis_tiles import fans
from vrtm.bake.scene import Scene as File
from vrtm.basis.folds import folds
from vrtm.basis.strain import Ruler, Strain

FRAMES, MIXTURES, HELD = 24, 16, 8


class Mesh(Protocol):
    """As `vrtm.Asset` takes it."""

    rest: np.ndarray
    indices: np.ndarray
    face_counts: np.ndarray
    uvs: np.ndarray
    uv_indices: np.ndarray


@dataclass(frozen=True)
class Samples:
    """Controls of poses."""

    fitted: np.ndarray
    held: np.ndarray
    motion: bool
    """Of one motion, every third of whose frames is held out; else weights are functions of the controls."""

    @staticmethod
    def of_motion(controls: np.ndarray) -> "Samples":
        held = np.arange(len(controls)) % 3 == 1
        return Samples(controls[~held], controls[held], True)


class Scene:
    """A mesh with its tiles; all texels of these are one array."""

    def __init__(self, name: str, mesh: Mesh, rigidity: dict[int, Path], size: int) -> None:
        self.name, self.size = name, size
        self.rest = mesh.rest.astype(float)
        self.asset = vrtm.Asset(
            vrtm.Device("cpu"),
            mesh.rest,
            mesh.indices,
            face_counts=mesh.face_counts,
            uvs=mesh.uvs,
            uv_indices=mesh.uv_indices,
        )
        corners = fans(mesh.face_counts)
        self.tiles, self.rulers, features = [], [], []
        for udim, path in rigidity.items():
            tile, place = self.asset.tile(udim), np.array([(udim - 1001) % 10, (udim - 1001) // 10])
            image = Image.open(path).convert("L")
            tile.set_rigidity(np.asarray(image))
            tile.set_settings(grid_width=size, grid_height=size)
            uvs = mesh.uvs[mesh.uv_indices[corners]].astype(float)
            inside = (np.floor(uvs.mean(axis=1)) == place).all(axis=1)
            vertices = mesh.indices[corners[inside]]
            pairs = np.stack([vertices, mesh.uv_indices[corners[inside]]], -1).reshape(-1, 2)
            numbers = np.unique(pairs, axis=0, return_inverse=True)[1].reshape(-1, 3)
            rigid = np.asarray(image.resize((size, size), Image.Resampling.BOX)) / 255
            self.rulers.append(Ruler(uvs[inside] - place, numbers, vertices, rigid))
            features.append(label(rigid > 0.5)[0] - 1)
            self.tiles.append(tile)
        at = (np.arange(size) + 0.5) / size
        x, y = np.meshgrid(at, at[::-1])
        self.at = np.concatenate([np.stack([x + 2 * k, y], -1).reshape(-1, 2) for k in range(len(self.tiles))])
        start = np.cumsum([0] + [found.max() + 1 for found in features])
        self.features = np.concatenate([np.where(f >= 0, f + s, -1).ravel() for f, s in zip(features, start)])

    def pose(self, controls: np.ndarray) -> np.ndarray:
        """(vertices, 3)."""
        raise NotImplementedError

    def samples(self) -> Samples:
        """The poses that are fitted, and those that are held out."""
        raise NotImplementedError

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


class Shapes(Scene):
    """The folder of an asset, whose frames are the shapes of its rig."""

    def __init__(self, folder: Path, size: int) -> None:
        facts = json.loads((folder / "asset.json").read_text())
        with File(str(folder / "rest.obj")) as file:
            (shape,) = file.shapes
        super().__init__(
            facts["name"], shape, {int(udim): folder / name for udim, name in facts["rigidity"].items()}, size
        )
        frames = np.fromfile(folder / "frames.f32", "<f4")
        self.shapes = frames.reshape(-1, len(self.rest), 3).astype(float) - self.rest

    def pose(self, controls: np.ndarray) -> np.ndarray:
        return self.rest + np.tensordot(controls, self.shapes, 1)

    def samples(self) -> Samples:
        """Of up to four shapes a motion from shape to shape; else each alone, and mixtures of them."""
        count, random = len(self.shapes), np.random.default_rng(5)
        if count > 4:
            some = random.random((MIXTURES + HELD, count)) < 0.4
            mixtures = np.where(some, random.uniform(0.2, 0.9, some.shape), 0)
            return Samples(np.vstack([np.eye(count), mixtures[:MIXTURES]]), mixtures[MIXTURES:], False)
        time = np.linspace(0, count, FRAMES)
        whole = np.minimum(time.astype(int), count - 1)
        keys = np.vstack([np.zeros(count), np.eye(count)])
        share = (time - whole)[:, None]
        return Samples.of_motion(keys[whole] * (1 - share) + keys[whole + 1] * share)


class Character(Scene):
    """A rig with clips, and a rigidity map of its tile."""

    def __init__(self, path: Path, rigidity: Path, size: int) -> None:
        self.rig = Rig(path)
        super().__init__(path.stem, self.rig, {1001: rigidity}, size)

    def pose(self, controls: np.ndarray) -> np.ndarray:
        return self.rig.pose(controls)

    def samples(self) -> Samples:
        """Of a rig with one clip the clip is the motion; else the last clip is held out."""
        count = len(self.rig.clips)
        if count == 1:
            return Samples.of_motion(self.rig.frames(0, FRAMES))
        fitted = [self.rig.frames(k, FRAMES // (count - 1)) for k in range(count - 1)]
        return Samples(np.vstack(fitted), self.rig.frames(count - 1, HELD), False)
