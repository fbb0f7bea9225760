"""Models: polygons with UVs in UDIM tiles, poses and rigidity, written and read as asset folders; y is up."""

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import obj
from PIL import Image


@dataclass
class Model:
    name: str
    rest: np.ndarray  # (vertices, 3)
    counts: np.ndarray  # corners of each polygon
    indices: np.ndarray  # the vertex of each corner
    uvs: np.ndarray
    uv_indices: np.ndarray
    frames: np.ndarray  # (frames, vertices, 3)
    rigidity: dict = field(default_factory=dict)  # UDIM number: (height, width), 0 to 1, first row at v = 1
    notes: list = field(default_factory=list)

    def triangles(self):
        """Fans of the polygons: vertices and UVs of triangles, (triangles, 3) each."""
        corners = obj.fans(self.counts)
        return self.indices[corners], self.uv_indices[corners]

    def udims(self):
        """The tiles that triangles lie in."""
        middle = self.uvs[self.triangles()[1]].mean(1)
        return sorted(set((1001 + np.floor(middle[:, 0]) + 10 * np.floor(middle[:, 1])).astype(int).tolist()))

    def write(self, folder):
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        corners = np.stack([self.indices, self.uv_indices], -1)
        obj.write(folder / "rest.obj", self.rest, self.uvs, self.counts, corners)
        self.frames.astype("<f4").tofile(folder / "frames.f32")
        for udim, map in self.rigidity.items():
            Image.fromarray(np.rint(np.clip(map, 0, 1) * 255).astype(np.uint8)).save(folder / f"rigidity.{udim}.png")
        facts = {
            "name": self.name,
            "vertices": len(self.rest),
            "faces": len(self.counts),
            "frames": len(self.frames),
            "udims": self.udims(),
            "rigidity": {str(udim): f"rigidity.{udim}.png" for udim in self.rigidity},
            "frame_notes": self.notes,
            "licence": "MIT OR Apache-2.0",
        }
        (folder / "asset.json").write_text(json.dumps(facts, indent=1) + "\n")


def read(folder):
    """The model of an asset folder: asset.json, rest.obj, frames.f32 and rigidity maps."""
    folder = Path(folder)
    facts = json.loads((folder / "asset.json").read_text())
    rest, uvs, counts, corners = obj.read(folder / "rest.obj")
    frames = np.fromfile(folder / "frames.f32", "<f4")
    if frames.size % rest.size:
        raise ValueError(f"{folder / 'frames.f32'}: not a whole number of frames of {len(rest)} vertices")
    rigidity = {
        int(udim): np.asarray(Image.open(folder / file).convert("L"), np.float32) / 255
        for udim, file in facts["rigidity"].items()
    }
    return Model(
        facts["name"], rest, counts, corners[:, 0], uvs, corners[:, 1],
        frames.reshape(-1, len(rest), 3).astype(float), rigidity, facts.get("frame_notes", []),
    )  # fmt: skip


class Builder:
    """Collects grids of quadrilaterals and fans of triangles that share vertices."""

    def __init__(self):
        self.points, self.uvs, self.polygons = [], [], []

    def vertices(self, points):
        """Adds points (..., 3); returns their numbers, (...)."""
        first = sum(map(len, self.points))
        self.points.append(points.reshape(-1, 3))
        return first + np.arange(len(self.points[-1])).reshape(points.shape[:-1])

    def _uvs(self, uv):
        first = sum(map(len, self.uvs))
        self.uvs.append(uv.reshape(-1, 2))
        return first + np.arange(len(self.uvs[-1])).reshape(uv.shape[:-1])

    def chart(self, vertices, uv):
        """Quadrilaterals between vertices (n, m), a chart with UVs (n, m, 2)."""
        uv = self._uvs(uv)
        quads = [np.stack([a[:-1, :-1], a[1:, :-1], a[1:, 1:], a[:-1, 1:]], -1).reshape(-1, 4) for a in (vertices, uv)]
        self.polygons += [np.stack(pair, -1) for pair in zip(*quads)]

    def fan(self, ring, middle, centre, radius, turn=1):
        """Closes a ring of vertices with triangles to a point: a round chart."""
        [tip] = self.vertices(np.array([middle], float))
        angle = turn * 2 * np.pi * np.arange(len(ring)) / len(ring)
        uv = self._uvs(np.concatenate([[centre], centre + radius * np.stack([np.cos(angle), np.sin(angle)], -1)]))
        for i in range(len(ring)):
            j = (i + 1) % len(ring)
            self.polygons.append(np.array([[ring[i], uv[i + 1]], [ring[j], uv[j + 1]], [tip, uv[0]]]))

    def model(self, name, pose, notes):
        """The model, with a frame for each note: `pose` takes the points and the frame's number, from 0."""
        points = np.concatenate(self.points)
        corners = np.concatenate(self.polygons)
        frames = np.stack([pose(points, k) for k in range(len(notes))])
        counts = np.array([len(polygon) for polygon in self.polygons])
        return Model(name, points, counts, corners[:, 0], np.concatenate(self.uvs), corners[:, 1], frames, {}, notes)


def closed(index):
    """Vertices of a tube: the first column again at the end, for the seam."""
    return np.concatenate([index, index[:, :1]], 1)


def rectangle(low, high, n, m):
    """UVs (n, m, 2) of a rectangle."""
    u, v = np.meshgrid(np.linspace(low[0], high[0], n), np.linspace(low[1], high[1], m), indexing="ij")
    return np.stack([u, v], -1)


def smooth(low, high, x):
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def bump(centre, width, x):
    return 1 - smooth(0, width, np.abs(x - centre))
