"""Wavefront OBJ: a mesh at rest from one file, and a file for each pose. Polygons stay polygons, vertices and UVs keep
their order in the file.

Only `v`, `vt` and `f` are read, by the rules of docs/bake.md, which the bake program has, too. Here: readers at hand
either merge vertices and UVs or turn a number that cannot be read into 0, and none tells a vertex without a colour from
a white one.
"""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vrtm.bake.scene.axes import Axes
from vrtm.bake.scene.poses import find_poses
from vrtm.bake.scene.timing import Clock
from vrtm.bake.scene.topology import bare_faces, check_faces, check_mesh, luminance, unique_names, without_uvs
from vrtm.bake.scene.types import SceneError, SceneOptions, Shape, Source, frame_number

_LAST = np.iinfo(np.int32).max
_DIGITS = 1000
_COMMENT = re.compile(r"(^|\s)#.*")
# The number behind a slash may be missing.
CORNER = re.compile(r"([+-]?[0-9]+)(?:/([+-]?[0-9]+)?(?:/(?:[+-]?[0-9]+)?)?)?")


class ObjSource(Source):
    """One shape. See `vrtm.bake.scene.Scene`."""

    def __init__(self, path: str, options: SceneOptions) -> None:
        super().__init__(path, options)
        self.has_subframes = False
        # Files with numbers have no times: 24 a second, as films.
        self.clock, self.codes, self.rate, self.axes = Clock(), 24.0, "", Axes()
        self._mesh = read_obj(path)
        self._last: dict[str, np.ndarray] = {}
        if len(self._mesh.counts) == 0:
            raise SceneError(f"{path}: no faces")
        for name in (*options.meshes, *options.exclude):
            self.warnings.append(f"{path}: an OBJ file is one mesh, whatever --meshes or --exclude says ({name})")
        if options.world:
            raise SceneError(f"{path}: an OBJ file has no transforms above its mesh, which --world asks for")
        if options.fps is not None:
            raise SceneError(f"{path}: poses from OBJ files have numbers and no times, which --fps asks for")
        if options.uv:
            raise SceneError(f"{path}: an OBJ file has one UV set, which has no name: there is no '{options.uv[0]}'")
        if (self._mesh.uv_indices < 0).all():
            raise SceneError(f"{path}: no faces with UVs (vt)")
        bare = bare_faces(self._mesh.counts, self._mesh.uv_indices)
        self.warnings += [f"{path}: {bare}"] if bare else []
        if options.subdivide:
            raise SceneError(f"{path}: an OBJ file states no subdivision surface, which --subdivide refines")
        if not options.poses:
            self.warnings.append(f"{path}: without --poses, its own shape is the only pose")
        self._poses = find_poses(options.poses, self.warnings, self.left_out) if options.poses else {1: path}
        self.frames = tuple(sorted(self._poses))
        self.files = (path, *self._poses.values())
        name = unique_names([Path(path).stem])[0]
        rest, rest_from = self._mesh.positions, options.rest or path
        if options.rest == "first":
            rest, rest_from = self._read(self.frames[0]), f"first frame {self.frames[0]}"
        elif options.rest is not None and options.rest.startswith("frame:"):
            rest = self._read(frame_number(options.rest))
        elif options.rest in ("bind", "pref"):
            raise SceneError(f"{path}: an OBJ file has no rest pose of the kind '{options.rest}'")
        elif options.rest is not None:
            rest, _ = rest_from_file(options.rest, path, self._mesh.counts, self._mesh.indices, len(rest))
        arrays = (rest, self._mesh.counts, self._mesh.indices, self._mesh.uvs, self._mesh.uv_indices)
        rigidity, mask = map(self._colours, (options.rigidity_primvar, options.mask_primvar))
        made = Shape(name, path, *arrays, "vt", vertex_rigidity=rigidity, vertex_mask=mask, rest_from=rest_from)
        self.shapes = (replace(made, instances=(path,)),)

    def _colours(self, name: str | None) -> np.ndarray | None:
        if name is None:
            return None
        if name != "colors":
            raise SceneError(f"{self.path}: an OBJ file has no values per vertex but 'colors', not '{name}'")
        if self._mesh.colours is None:
            raise SceneError(f"{self.path}: not all vertices have a colour (v x y z r g b)")
        return luminance(self._mesh.colours).astype(np.float32)

    def _read(self, frame: float) -> np.ndarray:
        if frame not in self._poses:
            raise SceneError(f"{self.path}: there is no pose {frame:g}, only {self.frames[0]} to {self.frames[-1]}")
        path = self._poses[int(frame)]
        if path not in self._last:
            # One of them, which is asked for several times before the next: text takes long to read.
            self._last = {path: self._read_file(path)}
        return self._last[path]

    def _read_file(self, path: str) -> np.ndarray:
        pose = self._mesh if path == self.path else read_obj(path)
        found, wanted = (len(of.positions) for of in (pose, self._mesh))
        if found != wanted:
            raise SceneError(f"{path}: {found} vertices, but the rest mesh has {wanted}")
        if len(pose.counts):
            check_faces(path, pose.counts, pose.indices, self._mesh.counts, self._mesh.indices)
        return pose.positions

    def positions(self, shape: Shape, frame: float) -> np.ndarray:
        """(vertices, 3) f64 of the pose's file; its faces, where it has some, must be those of the rest mesh."""
        return self._read(frame)


@dataclass(frozen=True)
class ObjFile:
    """Arrays of an OBJ file; indices count from 0, and -1 stands for a corner without UV."""

    positions: np.ndarray
    colours: np.ndarray | None
    uvs: np.ndarray
    counts: np.ndarray
    indices: np.ndarray
    uv_indices: np.ndarray


def read_obj(path: str) -> ObjFile:
    """Reads a file. Raises SceneError that names the line where it cannot be understood."""
    rows: dict[str, list[tuple[int, str]]] = {"v": [], "vt": [], "f": []}
    seen: list[tuple[int, int]] = []  # vertices and UVs before each face, which negative indices count back from
    for number, line in _statements(_text(path)):
        word, *rest = line.split(maxsplit=1)
        if word in rows:
            rows[word].append((number, rest[0] if rest else ""))
            if word == "f":
                seen.append((len(rows["v"]), len(rows["vt"])))
    vertices = _numbers(path, rows["v"], 3, (3, 4, 6, 7))
    uvs = _numbers(path, rows["vt"], 2, (1, 2, 3))
    counts, corners = _faces(path, rows["f"], seen)
    indices, uv_indices = corners[:, 0], corners[:, 1]
    if len(counts):
        check_mesh(path, counts, indices, len(vertices))
    outside = np.flatnonzero(uv_indices >= len(uvs))
    if len(outside):
        raise SceneError(f"{path}: a face names the vt {int(uv_indices[outside[0]]) + 1}, but there are {len(uvs)}")
    colours = vertices[:, 3:6] if vertices.shape[1] >= 6 else None
    return ObjFile(vertices[:, :3], colours, uvs[:, :2], counts, indices, without_uvs(counts, uv_indices))


def _text(path: str) -> str:
    """The file's text; what is no UTF-8, as names may be, counts for nothing."""
    if os.path.exists(path) and not os.path.isfile(path):
        # A pipe would be waited for, and a device may have no end.
        raise SceneError(f"{path}: is no file")
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise SceneError(f"{path}: {error.strerror or error}") from error
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise SceneError(f"{path}: a file in UTF-16: save it as UTF-8")
    if b"\0" in content[:1024]:
        raise SceneError(f"{path}: no text, or one in UTF-16: save it as UTF-8")
    return content.decode("utf-8-sig", errors="replace")


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """(number of the first line, text) of each statement, without comments; none of them is empty."""
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    first, before = 0, ""
    for number, line in enumerate(text.split("\n"), 1):
        first = first if before else number
        if "#" in line:
            # A comment ends with its line, even at a backslash, and begins with a word.
            line = before + _COMMENT.sub("", line)
        elif line.endswith("\\"):
            before += line[:-1] + " "
            continue
        else:
            line = before + line
        before = ""
        if line and not line.isspace():
            yield first, line
    if before.strip():
        yield first, before


def _numbers(path: str, rows: list[tuple[int, str]], least: int, widths: tuple[int, ...]) -> np.ndarray:
    """(rows, numbers) f64; a `v` may have a weight and a colour after its place, a `vt` one or three numbers."""
    split = [row.split() for _, row in rows]
    # Python takes 1_000 for a number, and no other program does.
    wrong = next(((number, row) for number, row in rows if "_" in row), None)
    if wrong:
        raise SceneError(f"{path}: line {wrong[0]}: '{wrong[1].strip()[:60]}' is not {least} numbers")
    width = max(map(len, split), default=least)
    try:
        if all(len(row) == width for row in split):
            table = np.array(split, np.float64).reshape(-1, width)
        else:
            # Vertices of which only some have colours count as having none; a missing v is 0.
            width = max(least, min(map(len, split)))
            table = np.array([(row + ["0"] * least)[:width] for row in split], np.float64)
    except ValueError:
        table = None
    for (number, text), row in zip(rows, split):
        if len(row) not in widths or (table is None and not all(map(_is_number, row))):
            raise SceneError(f"{path}: line {number}: '{text.strip()[:60]}' is not {least} numbers")
    if table is None:
        raise SceneError(f"{path}: numbers that cannot be read")
    if table.shape[1] == 1:
        table = np.column_stack([table, np.zeros(len(table))])
    if table.shape[1] == 7:  # x y z w r g b
        table = np.delete(table, 3, axis=1)
    return table


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _faces(path: str, rows: list[tuple[int, str]], seen: list[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    counts = np.zeros(len(rows), np.int32)
    corners: list[tuple[int, int]] = []
    for face, ((number, text), (vertices, uvs)) in enumerate(zip(rows, seen)):
        words = text.split()
        counts[face] = len(words)
        if len(words) < 3:
            raise SceneError(f"{path}: line {number}: face {face + 1} has {len(words)} corners")
        for word in words:
            found = CORNER.fullmatch(word)
            if not found:
                raise SceneError(f"{path}: line {number}: '{word[:60]}' is not the corner of a face")
            # Python refuses to read numbers of thousands of digits.
            vertex, uv = (int(digits[:_DIGITS] or 0) for digits in (found[1], found[2] or ""))
            if vertex == 0 or (uv == 0 and found[2]):
                raise SceneError(
                    f"{path}: line {number}: '{word[:60]}' is not the corner of a face: indices begin at 1"
                )
            corner = (vertex - 1 if vertex > 0 else vertices + vertex, uv - 1 if uv >= 0 else uvs + uv)
            if max(corner) > _LAST:
                raise SceneError(f"{path}: line {number}: '{word[:60]}' names what the file does not have")
            if corner[0] < 0 or corner[1] < -1 or (uv < 0 and corner[1] < 0):
                raise SceneError(f"{path}: line {number}: '{word[:60]}' names what stands before the file's first")
            corners.append(corner)
    return counts, np.array(corners, np.int32).reshape(-1, 2)


def rest_from_file(
    file: str, path: str, counts: np.ndarray, indices: np.ndarray, points: int
) -> tuple[np.ndarray, float | None]:
    """(vertices, 3) of the mesh of `file` that has the same path, else the same name, else is its only one; at the
    file's first frame; and how many meters its unit is, None if the file does not say it. Raises SceneError if no mesh
    fits, or its faces are not those of the mesh."""
    meters: dict[str, float | None] = {}
    if not os.path.isfile(file):
        raise SceneError(f"--rest {file}: no such file, and none of bind, pref, first and frame:N")
    if file.lower().endswith(".obj"):
        mesh = read_obj(file)
        found = [("", mesh.positions, mesh.counts, mesh.indices)]
    elif file.lower().endswith(".abc"):
        from vrtm.bake.scene.alembic_file import AlembicFile

        found = AlembicFile(file).meshes_at_first_frame()
    else:
        from vrtm.bake.scene.usd_stage import meshes_at_first_frame

        found, meters = meshes_at_first_frame(file)
    same = [mesh for mesh in found if mesh[0] == path]
    same = same or [mesh for mesh in found if mesh[0].rsplit("/", 1)[-1] == path.rsplit("/", 1)[-1]]
    same = same or (found if len(found) == 1 else [])
    if len(same) != 1:
        raise SceneError(f"{file}: {len(same) or 'no'} meshes have the name of {path}, whose rest is asked for")
    where, positions, its_counts, its_indices = same[0]
    check_faces(f"{file}{where and ' ' + where}", its_counts, its_indices, counts, indices)
    if len(positions) != points:
        raise SceneError(f"{file}{where and ' ' + where}: {len(positions)} vertices, but {path} has {points}")
    return positions, meters.get(where)
