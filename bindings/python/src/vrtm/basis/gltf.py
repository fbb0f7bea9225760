"""Binary glTF 2.0: a mesh with morph targets of positions and of UVs, which the same weights drive, and an animation of
these weights."""

import json
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

_FLOAT, _UINT = 5126, 5125
_ARRAY, _ELEMENTS = 34962, 34963
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}


@dataclass(frozen=True, eq=False)
class Morph:
    """A morph target: the changes that a weight of 1 adds."""

    name: str
    positions: np.ndarray
    """(vertices, 3)."""
    uvs: np.ndarray
    """(vertices, 2), v up."""


@dataclass(eq=False)
class _Buffer:
    """The one buffer of the file, with its views and accessors."""

    data: bytearray = field(default_factory=bytearray)
    views: list[dict] = field(default_factory=list)
    accessors: list[dict] = field(default_factory=list)

    def add(self, values: np.ndarray, target: int | None = None, limits: bool = False) -> int:
        """The number of an accessor of (count,) or (count, components)."""
        kind = _UINT if values.dtype.kind in "ui" else _FLOAT
        packed = np.ascontiguousarray(values, "<u4" if kind == _UINT else "<f4")
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": packed.nbytes}
        self.views.append(view if target is None else view | {"target": target})
        # All numbers have four bytes, so that all views are aligned.
        self.data += packed.tobytes()
        rows = packed.reshape(len(packed), -1)
        accessor = {
            "bufferView": len(self.views) - 1,
            "componentType": kind,
            "count": len(packed),
            "type": [*_WIDTHS][rows.shape[1] - 1],
        }
        if limits:
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def glb(
    name: str,
    positions: np.ndarray,
    uvs: np.ndarray,
    tiles: dict[str, np.ndarray],
    morphs: Sequence[Morph],
    times: np.ndarray,
    weights: np.ndarray,
    generator: str,
) -> bytes:
    """The bytes of a file. `positions`: (vertices, 3) at rest. `uvs`: (vertices, 2) within their tile, v up. `tiles`:
    the triangles (count, 3) of each, by the name of its material. `times`: (frames,) in seconds, ascending; `weights`:
    (frames, morphs)."""
    buffer = _Buffer()

    def added(positions: np.ndarray, uvs: np.ndarray) -> dict[str, int]:
        return {"POSITION": buffer.add(positions, _ARRAY, limits=True), "TEXCOORD_0": buffer.add(uvs, _ARRAY)}

    attributes = added(positions, np.stack([uvs[:, 0], 1 - uvs[:, 1]], -1))
    # Programs differ in what they make of a target without positions: all have both.
    targets = [added(morph.positions, morph.uvs * (1, -1)) for morph in morphs]
    more = {"targets": targets} if targets else {}
    primitives = [
        {"attributes": attributes, "indices": buffer.add(triangles.reshape(-1), _ELEMENTS), "material": k, **more}
        for k, triangles in enumerate(tiles.values())
    ]
    mesh: dict = {"name": name, "primitives": primitives}
    document: dict = {
        # First, so that a program tells by the first bytes who wrote the file.
        "asset": {"generator": generator, "version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": name, "mesh": 0}],
        "meshes": [mesh],
        "materials": [{"name": tile} for tile in tiles],
    }
    if morphs:
        mesh |= {"weights": [0.0] * len(morphs), "extras": {"targetNames": [morph.name for morph in morphs]}}
        sampler = {"input": buffer.add(times, limits=True), "output": buffer.add(weights.reshape(-1))}
        channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
        document["animations"] = [{"name": "motion", "samplers": [sampler], "channels": [channel]}]
    document["buffers"] = [{"byteLength": len(buffer.data)}]
    document |= {"bufferViews": buffer.views, "accessors": buffer.accessors}
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = ((b"JSON", text), (b"BIN\0", buffer.data))
    body = b"".join(struct.pack("<I4s", len(data), kind) + data for kind, data in chunks)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def read(data: bytes) -> tuple[dict, Callable[[int], np.ndarray]]:
    """The document of a file, and a function from the number of an accessor to its values, (count, components) f64."""
    length = struct.unpack_from("<I", data, 12)[0]
    # A chunk's length and kind have four bytes each.
    document, start = json.loads(data[20 : 20 + length]), 28 + length

    def values(number: int) -> np.ndarray:
        of = document["accessors"][number]
        kind, width = {_FLOAT: "<f4", _UINT: "<u4"}[of["componentType"]], _WIDTHS[of["type"]]
        at = start + document["bufferViews"][of["bufferView"]].get("byteOffset", 0) + of.get("byteOffset", 0)
        return np.frombuffer(data, kind, of["count"] * width, at).reshape(-1, width).astype(np.float64)

    return document, values
