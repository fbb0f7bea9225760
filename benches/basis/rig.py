"""A skinned character of a glTF 2.0 file: its mesh, and poses by linear blend skinning from its own clips."""

import base64
import json
import struct
from pathlib import Path

import numpy as np

_KINDS = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_PARTS = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}


class Rig:
    """The first skin of a file, with the first mesh that it moves. A pose is a row of the joints' rotations,
    quaternions less those at rest; translations and scales are those of the file's nodes."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        self.binary = b""
        if data[:4] == b"glTF":
            (size,) = struct.unpack_from("<I", data, 12)
            data, self.binary = data[20 : 20 + size], data[28 + size :]
        self.json, self.folder = json.loads(data), path.parent
        self.nodes = self.json["nodes"]
        node = next(n for n in self.nodes if "skin" in n)
        skin, primitive = self.json["skins"][node["skin"]], self.json["meshes"][node["mesh"]]["primitives"][0]
        self.joints, inverse = skin["joints"], self._values(skin["inverseBindMatrices"])
        self.inverse = inverse.reshape(-1, 4, 4).swapaxes(1, 2).astype(float)
        self.parents = {child: k for k, n in enumerate(self.nodes) for child in n.get("children", ())}
        named = {name: self._values(number) for name, number in primitive["attributes"].items()}
        corners = np.arange(len(named["POSITION"]))
        if "indices" in primitive:
            corners = self._values(primitive["indices"]).ravel().astype(np.uint32)
        # Vertices are split along seams: those with the same place and bones are one.
        bones = np.hstack([named[name].astype(float) for name in ("POSITION", "JOINTS_0", "WEIGHTS_0")])
        _, first, number = np.unique(bones, axis=0, return_index=True, return_inverse=True)
        self.rest = named["POSITION"][first].astype(np.float32)
        self.bones, self.weights = named["JOINTS_0"][first].astype(int), named["WEIGHTS_0"][first].astype(float)
        self.weights /= self.weights.sum(axis=1, keepdims=True)
        self.indices = number.reshape(-1)[corners].astype(np.uint32)
        u, v = named["TEXCOORD_0"].T.astype(np.float32)
        pairs = np.column_stack([number.reshape(-1), u, 1 - v])
        of_uvs, uv_number = np.unique(pairs, axis=0, return_inverse=True)
        self.uvs = of_uvs[:, 1:].astype(np.float32)
        self.uv_indices = uv_number.reshape(-1)[corners].astype(np.uint32)
        self.face_counts = np.full(len(corners) // 3, 3, np.uint32)
        self.at_rest = self._at_rest()
        self.clips = [self._clip(clip) for clip in self.json["animations"]]

    def frames(self, clip: int, count: int) -> np.ndarray:
        """(count, joints * 4): the poses of a clip that goes on where it began."""
        tracks = self.clips[clip]
        times = np.linspace(0, max(at[-1] for at, _ in tracks.values()), count, endpoint=False)
        found = np.empty((count, len(self.joints), 4))
        for k, joint in enumerate(self.joints):
            at, values = tracks.get(joint, (np.zeros(1), self._part(joint, "rotation")[None]))
            # Neighbours on the same side: what is interpolated linearly is near to what turns along an arc.
            turned = np.cumprod(np.r_[1, np.where((values[1:] * values[:-1]).sum(axis=1) < 0, -1, 1)])[:, None]
            found[:, k] = np.stack([np.interp(times, at, column) for column in (values * turned).T], -1)
        found /= np.linalg.norm(found, axis=-1, keepdims=True)
        # Of both signs that of the rest.
        away = (found * self.at_rest).sum(axis=-1, keepdims=True) < 0
        return (np.where(away, -found, found) - self.at_rest).reshape(count, -1)

    def pose(self, rotations: np.ndarray) -> np.ndarray:
        """(vertices, 3), of a row of rotations."""
        turned = dict(zip(self.joints, rotations.reshape(-1, 4) + self.at_rest))
        worlds: dict[int, np.ndarray] = {}

        def world(node: int) -> np.ndarray:
            if node not in worlds:
                above = world(self.parents[node]) if node in self.parents else np.eye(4)
                worlds[node] = above @ self._local(node, turned.get(node))
            return worlds[node]

        moves = np.stack([world(joint) @ inverse for joint, inverse in zip(self.joints, self.inverse)])[:, :3]
        points = np.hstack([self.rest.astype(float), np.ones((len(self.rest), 1))])
        return np.einsum("vb,vbij,vj->vi", self.weights, moves[self.bones], points)

    def _at_rest(self) -> np.ndarray:
        """(joints, 4): the rotations in which the mesh is as it was bound."""
        bound = {joint: np.linalg.inv(inverse) for joint, inverse in zip(self.joints, self.inverse)}
        found = []
        for joint in self.joints:
            parent = self.parents.get(joint)
            own = self._part(joint, "rotation")
            if parent in bound:
                turn = (np.linalg.inv(bound[parent]) @ bound[joint])[:3, :3]
                u, _, v = np.linalg.svd(turn)
                turned = _quaternion(u @ v)
                own = -turned if turned @ own < 0 else turned
            found.append(own)
        return np.array(found)

    def _values(self, number: int) -> np.ndarray:
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        uri = self.json["buffers"][view["buffer"]].get("uri")
        if uri is None:
            data = self.binary
        else:
            inside = uri.startswith("data:")
            data = base64.b64decode(uri.split(",", 1)[1]) if inside else (self.folder / uri).read_bytes()
        kind, width = np.dtype(_KINDS[accessor["componentType"]]), _WIDTHS[accessor["type"]]
        start, size = view.get("byteOffset", 0) + accessor.get("byteOffset", 0), kind.itemsize * width
        step = view.get("byteStride", size)
        rows = np.lib.stride_tricks.as_strided(
            np.frombuffer(data, np.uint8)[start:], (accessor["count"], size), (step, 1), writeable=False
        )
        return np.ascontiguousarray(rows).view(kind)

    def _part(self, node: int, name: str) -> np.ndarray:
        return np.array(self.nodes[node].get(name, _PARTS[name]), float)

    def _local(self, node: int, rotation: np.ndarray | None) -> np.ndarray:
        if "matrix" in self.nodes[node]:
            return np.array(self.nodes[node]["matrix"], float).reshape(4, 4).T
        x, y, z, w = self._part(node, "rotation") if rotation is None else rotation
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        whole = np.eye(4)
        whole[:3, :3], whole[:3, 3] = turn * self._part(node, "scale"), self._part(node, "translation")
        return whole

    def _clip(self, clip: dict) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Times and rotations by joint."""
        found = {}
        for channel in clip["channels"]:
            if channel["target"]["path"] == "rotation":
                sampler = clip["samplers"][channel["sampler"]]
                times, values = self._values(sampler["input"]).ravel(), self._values(sampler["output"])
                found[channel["target"]["node"]] = times.astype(float), values.astype(float)
        return found


def _quaternion(m: np.ndarray) -> np.ndarray:
    """x, y, z, w of a rotation (Horn): the largest eigenvector."""
    k = np.empty((4, 4))
    k[:3, :3] = m + m.T - np.trace(m) * np.eye(3)
    k[:3, 3] = k[3, :3] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    k[3, 3] = np.trace(m)
    return np.linalg.eigh(k)[1][:, -1]
