"""Basis maps: a few maps whose weighted sums stand for those of all frames, with the weights, a rig's controls that
drive these, and figures."""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

import vrtm
from vrtm.bake import basis_morphs, basis_shapes, basis_tiles, frames, image_file, overwrite, staging
from vrtm.bake.basis_tiles import Measure, TileMaps
from vrtm.bake.failure import INPUT, TOLERANCE, Failure, one_line
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.frames import Frame
from vrtm.bake.image_file import Target
from vrtm.bake.mesh_work import FrameResult, MeshWork
from vrtm.bake.part import TileWork
from vrtm.bake.words import counted
from vrtm.bake.work import Work
from vrtm.basis.controls import PRODUCTS, drive
from vrtm.basis.fit import Basis, fit, fitted_weights, summed
from vrtm.basis.stored import FORMATS, HALF, Range, ending, numbers

VERSION = 5
"""Of the way of fitting: maps that were fitted in another way are not up to date."""


@dataclass
class Made:
    """Files and messages of all meshes' basis maps."""

    lines: list[str] = field(default_factory=list)
    failure: Failure | None = None
    """The reason that they are not as asked for."""
    written: int = 0
    """Files."""
    skipped: int = 0
    """Files that were up to date."""
    meshes: list[tuple[str, MeshWork, list[Frame]]] = field(default_factory=list)
    """The new files with morph targets, and the frames of each."""


def check(work: Work) -> Controls | None:
    """The controls of the frames. Raises Failure if they lack a frame, or none is left to fit maps to."""
    settings = work.settings
    missing = sorted(set(settings.held_out or ()) - set(work.frames))
    if missing:
        raise Failure(INPUT, f"--held-out {frames.text(missing)}: none of {frames.text(work.frames)}")
    if set(settings.held_out or ()) == set(work.frames):
        raise Failure(INPUT, "--held-out: no frame is left to fit basis maps to")
    controls = None if settings.controls is None else read_controls(settings.controls)
    if controls is not None:
        controls.of(work.frames)
    return controls


def write(work: Work, results: Sequence[FrameResult], stop: Callable[[], None]) -> Made:
    """Writes the basis maps of each mesh, and a file of weights. Raises Failure, SceneError."""
    controls, made = check(work), Made()
    for name, mesh in work.meshes.items():
        there = sorted(result.frame for result in results if result.mesh == name and result.tiles)
        if there:
            document, is_new = _MeshBasis(work, mesh, there, controls, stop).made()
            fitted = [row["frame"] for row in document["frames"]]
            made.meshes += [(path, mesh, fitted) for path in work.geometry_files(name).values() if is_new]
            made.lines += _told(document, work.basis_file(name))
            made.failure = made.failure or _failure(document, name)
            geometry = sum(kind in document for kind in ("gltf", "blend_shapes"))
            count = 1 + sum(len(tile["maps"]) for tile in document["files"]) + geometry
            made.written, made.skipped = made.written + is_new * count, made.skipped + (not is_new) * count
    return made


@dataclass
class _MeshBasis:
    """The basis of a mesh in the frames that have maps."""

    work: Work
    mesh: MeshWork
    frames: list[Frame]
    controls: Controls | None
    stop: Callable[[], None]

    @property
    def geometry_files(self) -> dict[str, str]:
        return self.work.geometry_files(self.mesh.shape.name)

    @property
    def form(self) -> str:
        """Numbers of the stored maps, one of `FORMATS`."""
        return self.work.settings.basis_format

    def made(self) -> tuple[dict, bool]:
        """The document of weights, and whether it was written, not up to date."""
        settings = self.work.settings
        held = [frame for frame in self.frames if frame in (settings.held_out or ())]
        fitted = [frame for frame in self.frames if frame not in held]
        if not fitted:
            raise Failure(INPUT, f"--held-out: {self.mesh.shape.path} has no map of any other frame")
        bound = settings.bound
        path = self.work.basis_file(self.mesh.shape.name)
        inputs = Fingerprint().text(VERSION, vrtm.version(), bound, settings.texture_size, fitted, held, self.form)
        for frame in self.frames:
            for file in self._files(frame):
                inputs.text(image_file.told(file).get("vrtm:inputs"))
        if self.geometry_files:
            inputs.array(basis_morphs.to_gltf(self.work, self.mesh)).text(self.mesh.shape.left_handed)
        if self.controls is not None:
            inputs.text(self.controls.names, self.controls.of(self.frames).tolist())
        known = self._known(path, inputs.hex())
        if known is not None:
            return known, False
        deltas, sizes = self._deltas(fitted)
        tiles = basis_tiles.tile_maps(self.mesh, sizes)
        # A map per frame may fold where few texels squeeze much; the sum must not in more places.
        allowed = [basis_tiles.fold_counts(tiles, delta) for delta in deltas]
        basis = fit(deltas, bound, lambda basis: not self._folding(tiles, basis, allowed), self.form)
        if basis is None:
            most, other = bound * settings.texture_size, f", or --basis-format {HALF}" if self.form == "unorm8" else ""
            told = f"{self.mesh.shape.path}: maps of {self.form} are off by more than {most:g} texels, or fold"
            raise Failure(INPUT, f"{told}: --max-error must be larger, or --texture-size smaller{other}")
        document = self._document(tiles, basis, deltas, fitted, held) | {"inputs": inputs.hex()}
        files = self._write(tiles, basis, inputs)
        document["files"] = files
        document |= self._geometry(fitted, basis) if self.geometry_files else {}
        self._sweep(len(basis))
        ordered = {"program": {"name": "vrtm bake", "version": vrtm.version()}} | document
        staging.write_bytes(path, (json.dumps(ordered, indent=1) + "\n").encode())
        return ordered, True

    def _known(self, path: str, inputs: str) -> dict | None:
        """The document that is there, if it and its maps are made of these inputs."""
        try:
            with open(path, encoding="utf-8") as file:
                document = json.load(file)
            if document.get("inputs") != inputs:
                return None
            for tile in self.mesh.tiles:
                for number in range(document["maps"]):
                    target = self._target(tile, number, (0, 0), inputs, None)
                    if image_file.up_to_date(target, self.work.settings.overwrite) is None:
                        return None
            for kind, path in self.geometry_files.items():
                if document[kind]["bytes"] != os.path.getsize(path):
                    return None
            return document
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None

    def _files(self, frame: Frame) -> list[str]:
        """The redirection maps of a frame, one per tile."""
        return [self.mesh.path(self.work.pattern, "redirect", frame, tile) for tile in self.mesh.tiles]

    def _deltas(self, wanted: list[Frame]) -> tuple[np.ndarray, list[tuple[int, int]]]:
        """(frames, texels of all tiles, 2), and the tiles' sizes."""
        rows, sizes = [], []
        for frame in wanted:
            self.stop()
            images = [basis_tiles.read_delta(path, self.work.settings.form) for path in self._files(frame)]
            sizes = [image.shape[1::-1] for image in images]
            rows.append(np.concatenate([image.reshape(-1, 2) for image in images]))
        return np.stack(rows), sizes

    def _folding(self, tiles: list[TileMaps], basis: Basis, allowed: list[list[int]]) -> bool:
        """True if the sum of a frame folds where the frame's own map does not."""
        for weights, own in zip(basis.weights, allowed):
            self.stop()
            counts = basis_tiles.fold_counts(tiles, summed(basis.maps, weights[None])[0])
            if any(count > most for count, most in zip(counts, own)):
                return True
        return False

    def _document(
        self, tiles: list[TileMaps], basis: Basis, deltas: np.ndarray, fitted: list[Frame], held: list[Frame]
    ) -> dict:
        driver, known = None, None
        if self.controls is not None:
            known = self.controls.of(fitted)
            try:
                driver = drive(self.controls.names, known, basis.weights)
            except ValueError as error:
                raise Failure(INPUT, f"--controls {self.controls.path}: {error}") from None
        settings = self.work.settings
        measure = Measure(self.work, self.mesh.shape, tiles, basis.maps, self.stop)
        rows = [measure.row(*of_frame) for of_frame in zip(basis.weights, deltas, fitted)]
        outside = []
        for frame in held:
            delta = self._deltas([frame])[0]
            if driver is not None and self.controls is not None:
                weights = driver(self.controls.of([frame])).astype(np.float32)
            else:
                weights = fitted_weights(basis.maps, delta)
            outside.append(measure.row(weights[0], delta[0], frame))
        most = max(row["folds"]["map"] for row in rows)
        texels, each = tiles[-1].texels.stop, 2 * np.dtype(FORMATS[self.form]).itemsize
        return {
            "mesh": self.mesh.shape.name,
            "maps": len(basis),
            "max_error": 1.0 if settings.max_error is None else settings.max_error,
            "texture_size": settings.texture_size,
            "format": self.form,
            "ranges": [{"offset": of.offset.tolist(), "scale": of.scale.tolist()} for of in basis.ranges],
            "bytes": {"basis": each * texels * len(basis), "maps": 4 * texels * len(fitted)},
            "worst": max(rows, key=lambda row: row["error"]),
            "worst_held_out": max(outside, key=lambda row: row["error"], default=None),
            "random": None if driver is None or known is None else measure.random(driver, known, most),
            "driver": None if driver is None else driver.document(),
            "frames": rows,
            "held_out": outside,
        }

    def _path(self, tile: TileWork, number: int, form: str) -> str:
        return self.mesh.path(self.work.pattern, "basis", number, tile, ending=ending(form))

    def _target(self, tile: TileWork, number: int, size: tuple[int, int], inputs: str, of: Range | None) -> Target:
        facts: dict[str, str | int] = {
            "vrtm:kind": "basis",
            "vrtm:form": "delta",
            "vrtm:mesh": self.mesh.shape.name,
            "vrtm:udim": tile.udim,
            "vrtm:map": number,
            "vrtm:version": vrtm.version(),
            "vrtm:inputs": inputs,
        }
        path, kind = self._path(tile, number, self.form), FORMATS[self.form]
        if self.form != HALF:
            # In the words that a shader has: UV += weight * (offset + scale * texel).
            facts |= {} if of is None else {"vrtm:offset": _list(of.offset), "vrtm:scale": _list(of.scale)}
            return Target(path, *size, ("R", "G", "B"), kind, facts, format="png")
        return Target(path, *size, ("R", "G", "B"), kind, facts, image_file.DATA)

    def _write(self, tiles: list[TileMaps], basis: Basis, inputs: Fingerprint) -> list[dict]:
        files = []
        for maps in tiles:
            names = []
            for number, (texels, of) in enumerate(zip(basis.maps, basis.ranges)):
                self.stop()
                target = self._target(maps.tile, number, maps.size, inputs.hex(), of)
                image = numbers(maps.image(texels), of, self.form)
                pixels = np.concatenate([image, np.zeros_like(image[..., :1])], axis=-1)
                # Raises Failure for one that somebody has painted on.
                image_file.up_to_date(target, self.work.settings.overwrite)
                image_file.write(target, pixels)
                names.append(os.path.relpath(target.path, self.work.settings.out))
            files.append({"udim": maps.tile.udim, "layer": maps.tile.layer, "size": list(maps.size), "maps": names})
        return files

    def _geometry(self, fitted: list[Frame], basis: Basis) -> dict:
        """Writes the mesh with morph targets, of the rig's controls and their products, or of the basis maps, and
        returns figures."""
        names, weights = [f"basis {k + 1}" for k in range(len(basis))], basis.weights
        if self.controls is not None:
            driver = drive(self.controls.names, self.controls.of(fitted), weights)
            if driver.form == PRODUCTS:
                names, weights = driver.term_names(), driver.terms(self.controls.of(fitted))
        found = basis_morphs.morphed(self.work, self.mesh, fitted, names, weights, self.stop)
        told, scene = {}, self.work.scene
        for kind, path in self.geometry_files.items():
            overwrite.check([(path, f"--{kind.replace('_', '-')}")], (), self.work.settings.overwrite)
            if kind == "gltf":
                seconds = [scene.seconds(frame) for frame in fitted]
                staging.write_bytes(path, found.glb(seconds, basis_morphs.to_gltf(self.work, self.mesh)))
            else:
                basis_shapes.write(path, found, scene)
            told[kind] = {"bytes": os.path.getsize(path)} | found.figures
        return told

    def _sweep(self, count: int) -> None:
        """Removes maps of an earlier basis that had more of them, or another format."""
        for tile in self.mesh.tiles:
            for number in range(len(self.work.frames)):
                kept = {self._path(tile, number, self.form)} if number < count else set()
                for path in {self._path(tile, number, form) for form in FORMATS} - kept:
                    image_file.remove(path, self.mesh.shape.name)


def _list(values: np.ndarray) -> str:
    return " ".join(f"{value:.9g}" for value in values.tolist())


def _told(document: dict, path: str) -> list[str]:
    worst, share = document["worst"], document["bytes"]
    lines = [
        f"{path}: {counted(document['maps'], 'basis map')} in place of {counted(len(document['frames']), 'map')}, "
        f"{share['basis'] / 1e6:.1f} MB of {share['maps'] / 1e6:.1f} MB; frame {worst['frame']} is the worst: "
        f"off by {worst['error']:.2f} texels{_strain(worst)}"
    ]
    outside = document["worst_held_out"]
    if outside is not None:
        told = f"held out: frame {outside['frame']} is the worst: off by {outside['error']:.2f} texels"
        lines.append(f"{told}{_strain(outside)}")
    return lines


def _strain(row: dict) -> str:
    own, one, total = (row["strain"][name] for name in ("own_uvs", "map", "basis"))
    if total is None:
        return ""
    return f", strain {own['rms']:.4f}, with its own map {one['rms']:.4f}, with the sum {total['rms']:.4f}"


def _failure(document: dict, name: str) -> Failure | None:
    random = document["random"]
    if random is None or not random["folding"]:
        return None
    values = ", ".join(f"{control} {value:g}" for control, value in random["worst"].items())
    return Failure(
        TOLERANCE,
        f"{name}: the sum of basis maps folds in {counted(random['folding'], 'pose')} of {random['poses']} with random "
        f"controls, in {counted(random['folds'], 'place')} with {values}: a frame with such a pose helps",
    )


@dataclass(frozen=True, eq=False)
class Controls:
    """A row of numbers per frame."""

    path: str
    names: tuple[str, ...]
    rows: dict[Frame, tuple[float, ...]]

    def of(self, wanted: Sequence[Frame]) -> np.ndarray:
        """(frames, controls). Raises Failure for a frame that the table lacks."""
        lacking = [frame for frame in wanted if frame not in self.rows]
        if lacking:
            raise Failure(INPUT, f"--controls {self.path}: no row for frame {frames.text(lacking)}")
        return np.array([self.rows[frame] for frame in wanted]).reshape(len(wanted), len(self.names))


def read_controls(path: str) -> Controls:
    """Reads comma-separated values: a first line `frame,smile,jaw`, and a line of numbers per frame. Raises Failure."""

    def bad(line: int, reason: str) -> Failure:
        return Failure(INPUT, f"--controls {path}:{line}: {reason}")

    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            table = [(n, [cell.strip() for cell in row]) for n, row in enumerate(csv.reader(file), 1) if any(row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise Failure(INPUT, f"--controls {path}: {one_line(getattr(error, 'strerror', None) or error)}") from error
    if not table or table[0][1][0].lower() != "frame" or len(table[0][1]) < 2:
        raise bad(1, "the first line must be 'frame', and the names of the controls, with commas between them")
    names = tuple(table[0][1][1:])
    if len(set(names)) < len(names) or "" in names:
        raise bad(1, "each control needs a name of its own")
    rows: dict[Frame, tuple[float, ...]] = {}
    for line, (first, *cells) in table[1:]:
        try:
            [frame] = frames.parse(first)
            values = tuple(map(float, cells))
        except ValueError:
            raise bad(line, f"'{','.join([first, *cells])}' is not a frame and numbers") from None
        if len(values) != len(names) or not all(map(math.isfinite, values)):
            raise bad(line, f"{len(names)} finite numbers are needed, one per control")
        if frame in rows:
            raise bad(line, f"frame {first} is there twice")
        rows[frame] = values
    return Controls(path, names, rows)
