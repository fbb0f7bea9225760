"""Geometry on the surface: instances, points, curves and detail meshes that ride on it over a shot."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence

import numpy as np

import vrtm
from vrtm.bake import carry_frames, overwrite
from vrtm.bake.carry_frames import Moved
from vrtm.bake.carry_parts import Nearest, in_parts
from vrtm.bake.carry_prims import CarriedPrim, Pose, Scatter
from vrtm.bake.failure import INPUT, Failure, describe, unwritable
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.frames import Frame
from vrtm.bake.mesh_work import MeshWork
from vrtm.bake.scene import SceneError
from vrtm.bake.scene.axes import placed
from vrtm.bake.scene.topology import fans
from vrtm.bake.settings import CONNECTED, is_alembic
from vrtm.bake.words import counted
from vrtm.bake.work import Work

VERSION = 2
"""Of the way of carrying: a file that was made in another way is not up to date."""
_FAR = 0.05
"""Of the diagonal of a mesh's bounding box: the largest distance, unless one is asked for."""
_LOOKED_AT = 256
"""Points of a prim whose distances tell which mesh it goes with."""
_TOO_FAR = 3
"""State of a point of a carrier; 1 and 2 are outside of charts, and in folded UVs."""


class Carry:
    """The prims that are carried, each bound to the mesh that is nearest. Raises Failure, SceneError."""

    def __init__(self, work: Work) -> None:
        settings = work.settings
        file = settings.carry or settings.scene
        if not (work.scene.is_usd or is_alembic(settings.scene)):
            raise Failure(INPUT, f"--carry-prims: {settings.scene} is neither USD nor Alembic, and has no world")
        if not os.path.isfile(file):
            raise Failure(INPUT, f"--carry {file}: no such file")
        self.work, self.file = work, file
        with work.scene.listening():
            self.scatter = _opened(file, work)
            self.files = self.scatter.files
            prims = self._prims()
        self.groups = self._grouped(prims)
        self.paths = {prim.path for group in self.groups for prim in group.prims}
        self.left_out = self.scatter.left_out
        told = [line for group in self.groups for line in group.told()]
        self._meant: dict[str, tuple[CarriedPrim, list[float], list[Pose]]] = {}
        self.warnings = [*self.scatter.warnings, *told]
        if self.groups and all((group.states == _TOO_FAR).all() for group in self.groups):
            raise Failure(INPUT, f"--carry-prims: {told[0]}: {file} must be in the world of the mesh at rest")

    def facts(self) -> list[str]:
        """A sentence per prim that is carried."""
        every = ((prim, group.mesh.shape.path) for group in self.groups for prim in group.prims)
        return [f"{of.path}: {of.kind}, {counted(len(of.roots), of.places)}, carried by {path}" for of, path in every]

    def write(self, stop: Callable[[], None], warn: Callable[[str], None]) -> tuple[list[dict], Counter]:
        """Writes the file, unless it is up to date; returns what the report tells of each mesh, and the numbers of
        files `written` and `skipped`. Each frame is solved once more, by the main process, unless a task of a farm has
        written its file. A task writes these alone. Raises Failure."""
        settings = self.work.settings
        path = settings.carry_file
        assert path is not None
        if not self.groups:
            # One of an earlier bake would move what stays now.
            if os.path.isfile(path) and overwrite.is_ours(path):
                os.remove(path)
            return [], Counter()
        if settings.task is not None:
            return [], Counter(state for group in self.groups for _, _, state in self._moved(group, stop))
        if lacking := self.work.lacking():
            warn(f"{path}: {lacking} (tasks of a farm that share the frames need --task)")
        with self.work.scene.listening():
            inputs = self._inputs(stop)
            known = self.scatter.known(path, inputs) if os.path.isfile(path) else None
            if known is not None:
                return json.loads(known), Counter(skipped=1)
            rows = self._solved(stop)
            try:
                for line in self.scatter.write(path, inputs, json.dumps(rows)):
                    warn(line)
            except OSError as error:
                raise unwritable(path, error) from error
        return rows, Counter(written=1)

    def differences(self) -> Iterator[str]:
        """The differences of the file, as its readers find it, from what it was meant to say; none if it was not
        written."""
        path = self.work.settings.carry_file
        with self.work.scene.listening():
            for prim, times, poses in self._meant.values():
                found = self.scatter.differences(path, prim, times, poses)
                yield from (f"{path}: {prim.path}: {what}" for what in found)

    def _prims(self) -> list[CarriedPrim]:
        work, settings = self.work, self.work.settings
        baked = [path for shape in work.shapes for path in shape.instances if self.file == settings.scene]
        self._rest = work.scene.source.rest_frame(work.shapes[0])
        prims: dict[str, CarriedPrim] = {}
        for path in settings.carry_prims:
            found = self.scatter.prims(path, self._rest, baked, settings.carry_pieces == CONNECTED)
            prims |= {prim.path: prim for prim in found}
        return list(prims.values())

    def _to_mesh(self, mesh: MeshWork, prim: CarriedPrim) -> np.ndarray:
        """(4, 4) from a prim's space to the mesh's at rest."""
        to_world = self.work.scene.source.to_world(mesh.shape, None)
        return self.scatter.to_world(prim, self._rest) @ _inverse(to_world, mesh.shape.path)

    def _from_mesh(self, mesh: MeshWork, prim: CarriedPrim, frame: Frame) -> np.ndarray:
        """(4, 4) from a mesh's space to the prim's in a pose."""
        to_world = self.work.scene.source.to_world(mesh.shape, frame)
        return to_world @ _inverse(self.scatter.to_world(prim, frame), prim.path)

    def _grouped(self, prims: list[CarriedPrim]) -> list[Group]:
        meshes = list(self.work.meshes.values())
        of: dict[str, list[CarriedPrim]] = {}
        for prim in prims:
            away = [_distance(mesh, prim, self._to_mesh(mesh, prim)) if len(meshes) > 1 else 0.0 for mesh in meshes]
            of.setdefault(meshes[int(np.argmin(away))].shape.name, []).append(prim)
        return [Group(mesh, of[name], self._to_mesh) for name, mesh in self.work.meshes.items() if name in of]

    def _poses(self, mesh: MeshWork, stop: Callable[[], None]) -> Iterator[tuple[Frame, np.ndarray]]:
        for frame in self.work.frames:
            stop()
            try:
                positions = self.work.scene.positions(mesh.shape, frame)
            except SceneError:
                # The bake says so.
                continue
            yield frame, positions

    def _inputs(self, stop: Callable[[], None]) -> str:
        """A hash of all that the file depends on."""
        settings = self.work.settings
        inputs = Fingerprint().text(VERSION, vrtm.version(), settings.carry_fit, settings.carry_pieces)
        inputs.text(self.scatter.digest())
        for group in self.groups:
            inputs.text(group.mesh.common.hex(), group.farthest)
            for prim, to_mesh in zip(group.prims, group.to_mesh):
                inputs.text(prim.path, prim.kind).array(prim.points).array(prim.roots).array(prim.turns).array(to_mesh)
            for frame, positions in self._poses(group.mesh, stop):
                inputs.text(frame, self.scatter.time(frame)).array(positions)
                for prim in group.prims:
                    inputs.array(self._from_mesh(group.mesh, prim, frame))
        return inputs.hex()

    def _moved(self, group: Group, stop: Callable[[], None]) -> Iterator[tuple[Frame, Moved, str]]:
        """The places of a group in each frame: solved, or read from the file of a task. A task writes its files; they
        are `written` or `skipped`."""
        mesh, warm, is_task = group.mesh, False, self.work.settings.task is not None
        for frame, positions in self._poses(mesh, stop):
            name, count = mesh.shape.name, len(group.states)
            path = self.work.carried_file(name, frame)
            target = carry_frames.target(path, name, frame, count, group.inputs, positions)
            moved = None if mesh.settings.warm else carry_frames.read(target)
            state = "skipped" if moved else "written"
            if moved is None:
                try:
                    # The first one does not start from what the bake solved last.
                    mesh.parts[0].solve(frame, positions, mesh.every_tile, False, mesh.releases, warm, stop)
                except SceneError:
                    continue
                warm, moved = mesh.settings.warm, group.moved()
                if is_task:
                    carry_frames.write(target, moved)
            yield frame, moved, state

    def _solved(self, stop: Callable[[], None]) -> list[dict]:
        """Adds all frames to the file, and returns what the report tells of each mesh."""
        rows = []
        for group in self.groups:
            worst, features, mesh = (0.0, None), 0, group.mesh
            for frame, moved, _ in self._moved(group, stop):
                time = self.scatter.time(frame)
                features = max(features, moved.features)
                worst = max(worst, (moved.rim, frame), key=lambda entry: entry[0])
                for prim, to_mesh, own in zip(group.prims, group.to_mesh, group.own):
                    from_mesh = self._from_mesh(mesh, prim, frame)
                    bound = group.states[own] != _TOO_FAR
                    points = prim.moved(moved.places[own], moved.turns[own], bound, to_mesh, from_mesh)
                    self.scatter.add(prim, time, *points)
                    world = placed(points[0], self.scatter.to_world(prim, frame))
                    _, times, poses = self._meant.setdefault(prim.path, (prim, [], []))
                    times.append(time)
                    # The first and the last one.
                    poses[1:] = [Pose(frame, time, *points, world)]
            rows.append(group.row() | {"features": features, "rim": worst[0], "rim_frame": worst[1]})
        return rows


class Group:
    """The prims that a mesh carries. Raises Failure."""

    def __init__(
        self, mesh: MeshWork, prims: Sequence[CarriedPrim], to_mesh: Callable[[MeshWork, CarriedPrim], np.ndarray]
    ) -> None:
        settings = mesh.settings
        self.mesh, self.to_mesh = mesh, [to_mesh(mesh, prim) for prim in prims]
        shape, surface = mesh.shape, None
        if any(prim.faces is not None for prim in prims):
            surface = Nearest(shape.rest[shape.indices[fans(shape.face_counts)]].astype(np.float64))
        self.prims = [
            prim if surface is None or prim.faces is None else in_parts(prim, own, surface)
            for prim, own in zip(prims, self.to_mesh)
        ]
        places = [placed(prim.roots, own) for prim, own in zip(self.prims, self.to_mesh)]
        ends = np.cumsum([0, *map(len, places)])
        self.own = [slice(*ends[k : k + 2]) for k in range(len(prims))]
        """Of each prim, its places among all."""
        self.farthest = settings.carry_farthest or _FAR * float(np.linalg.norm(np.ptp(mesh.shape.rest, axis=0)))
        try:
            at, fit = np.concatenate(places), settings.carry_fit
            self.carrier = mesh.parts[0].asset.carrier(positions=at, farthest=self.farthest, fit=fit)
        except vrtm.Error as error:
            raise describe(error, f"--carry-prims: {mesh.shape.path}") from error
        self.states = self.carrier.states()
        self.inputs = Fingerprint().text(VERSION, vrtm.version(), settings.carry_fit, mesh.common.hex(), self.farthest)
        """A hash of all that places depend on besides the pose."""
        self.inputs.array(at)

    def moved(self) -> Moved:
        """The places in the pose that was solved last."""
        found, info = self.carrier.fetch("positions", "matrices", dtype=np.float64), self.carrier.info
        assert found.positions is not None and found.matrices is not None
        return Moved(found.positions, found.matrices, info.features, info.rim)

    def told(self) -> list[str]:
        lines = []
        for prim, own in zip(self.prims, self.own):
            states, whole = self.states[own], counted(len(prim.roots), prim.places)
            far, outside = np.count_nonzero(states == _TOO_FAR), np.count_nonzero((states > 0) & (states < _TOO_FAR))
            if far:
                told = f"{prim.path}: {far} of {whole} {'is' if far == 1 else 'are'} farther than {self.farthest:.4g} "
                told += f"(--carry-farthest) from {self.mesh.shape.path}, and left where the shot has them"
                lines.append(told)
            if outside:
                told = f"{outside} of {whole} lie where {self.mesh.shape.path} has no UVs, or folded ones"
                lines.append(f"{prim.path}: {told}, and ride as if nothing were redirected")
        return lines

    def row(self) -> dict:
        """Row of the report, without the figures of frames."""
        prims = []
        for prim, own in zip(self.prims, self.own):
            counts = np.bincount(self.states[own], minlength=4).tolist()
            row = {"prim": prim.path, "kind": prim.kind, "places": len(prim.roots), "bound": counts[0]}
            prims.append(row | {"outside": counts[1], "folded": counts[2], "too_far": counts[3]})
        return {"mesh": self.mesh.shape.name, "farthest": self.farthest, "prims": prims}


def line(row: dict) -> str:
    count = {name: sum(prim[name] for prim in row["prims"]) for name in ("bound", "outside", "folded", "too_far")}
    rim = f", whose rims leave the surface by {row['rim']:.3g} (frame {row['rim_frame']})" if row["features"] else ""
    return (
        f"{row['mesh']} carries {counted(count['bound'], 'place')}, {counted(row['features'], 'rigid feature')}{rim}; "
        f"{count['outside'] + count['folded']} outside of UVs, {count['too_far']} too far"
    )


def _opened(file: str, work: Work) -> Scatter:
    if is_alembic(file):
        from vrtm.bake.scene.alembic_file import AlembicFile

        # Says what its package lacks.
        archive = AlembicFile(file)
        from vrtm.bake.carry_abc import AlembicScatter

        return AlembicScatter(archive, work.scene)
    from vrtm.bake.carry_usd import UsdScatter

    return UsdScatter(file, work.scene, work.frames)


def _inverse(matrix: np.ndarray, path: str) -> np.ndarray:
    if abs(np.linalg.det(matrix[:3, :3])) == 0:
        raise Failure(INPUT, f"--carry-prims: the transforms above {path} have a scale of 0")
    return np.linalg.inv(matrix)


def _distance(mesh: MeshWork, prim: CarriedPrim, to_mesh: np.ndarray) -> float:
    """Distance of a prim from a mesh's vertices and faces' centres, in the median."""
    shape = mesh.shape
    ends = np.cumsum(shape.face_counts)
    corners = np.add.reduceat(shape.rest[shape.indices], (ends - shape.face_counts)[shape.face_counts > 0], axis=0)
    there = np.concatenate([shape.rest, corners / shape.face_counts[shape.face_counts > 0, None]])
    roots = prim.roots[:: -(-len(prim.roots) // _LOOKED_AT)]
    away = [np.linalg.norm(there - place, axis=1).min() for place in placed(roots, to_mesh)]
    return float(np.median(away))
