"""A scene with its meshes, opened for baking: what the main process checks with, and what each worker bakes with."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from types import TracebackType

import OpenImageIO as oiio

import vrtm
from vrtm.bake import frames, layer_file, overwrite, warped
from vrtm.bake.failure import DEVICE, INPUT, Failure, describe, one_line
from vrtm.bake.mesh_work import FrameResult, MeshWork, unknown_tiles
from vrtm.bake.names import ONE_MESH, SEVERAL, Pattern
from vrtm.bake.scene import Scene, Shape
from vrtm.bake.settings import Settings


def _ignored(_level: str, _message: str) -> None:
    """The library's own log: what it says about meshes is said once, by the main process."""


class Work:
    """An open scene and the device. A context manager; not for several threads at once. Raises Failure."""

    def __init__(
        self, settings: Settings, threads: int, log: Callable[[str, str], None] | None = None, only: str | None = None
    ) -> None:
        """`threads`: of the library and of image files; 0 = one per core. `only`: open this mesh alone."""
        self.settings = settings
        oiio.attribute("threads", threads)
        try:
            self.device = vrtm.Device(settings.device, adapter=settings.adapter, threads=threads, log=log or _ignored)
        except vrtm.Error as error:
            # Whatever it is, another machine may have what this one lacks.
            raise Failure(DEVICE, f"--device {settings.device}: {one_line(error)}") from error
        self.scene = Scene(settings.scene, settings.options)
        if not self.scene.shapes:
            raise Failure(INPUT, f"{settings.scene}: no mesh with UVs")
        copies = warped.listed(settings.textures, settings.normal_maps, settings.normal_y == "down")
        self.meshes = {s.name: self._mesh(s, copies) for s in self.scene.shapes if only in (None, s.name)}
        self.frames, self.missing_frames = frames.clamp(settings.frames, self.scene.frames)
        if not self.frames:
            there = frames.text(self.scene.frames)
            raise Failure(INPUT, f"--frames: none of these is in {settings.scene}, which has {there or 'none'}")
        self.pattern = self._pattern(copies)

    def _mesh(self, shape: Shape, copies: tuple[warped.Copy, ...]) -> MeshWork:
        try:
            return MeshWork(self.settings, shape, self.device, copies)
        except (vrtm.Error, ValueError) as error:
            raise describe(error, f"{self.settings.scene} {shape.path}") from error

    def _pattern(self, copies: tuple[warped.Copy, ...]) -> Pattern:
        several = len(self.scene.shapes) > 1
        # Not by the frames and tiles of this call: another task may write the others.
        counts = {
            "<mesh>": len(self.scene.shapes),
            "<kind>": len(next(iter(self.meshes.values())).listed) + len(copies),
            "<frame>": len(self.frames),
            "<UDIM>": max(len(mesh.all_udims) for mesh in self.meshes.values()),
        }
        return Pattern(self.settings.name or (SEVERAL if several else ONE_MESH), counts)

    def notes(self) -> list[str]:
        """What is odd about the scene and the options, each as a sentence."""
        notes = list(self.scene.warnings)
        if self.missing_frames:
            notes.append(
                f"--frames: {self.settings.scene} has {frames.text(self.scene.frames)}, without "
                f"{frames.text(self.missing_frames)}, which are left out"
            )
        missing = unknown_tiles(self.settings, list(self.meshes.values()))
        if missing:
            notes.append(f"--tiles: no mesh has {', '.join(map(str, missing))}")
        return notes

    def check_files(self) -> None:
        """Raises Conflict if a file cannot be written without the loss of another, and Failure if a folder is missing."""
        settings = self.settings
        outputs = [] if settings.only_layer else [(name, "--out") for name in self._names()]
        inputs = [(settings.scene, "the scene")]
        for mesh in self.meshes.values():
            inputs += [(path, f"--{option}") for option, paths in mesh.maps.items() for path in paths.values()]
            inputs += [(path, "--texture") for _, paths in mesh.textures for path in paths.values()]
        inputs += [(path, "a file of the scene") for path in self.scene.files]
        if settings.layer:
            outputs += [(path, "--layer") for path in layer_file.names(settings)]
        if settings.report is not None:
            outputs.append((settings.report, "--report"))
        out = os.path.join(os.path.abspath(settings.out), "")
        for option, path in (("--layer", settings.layer), ("--report", settings.report)):
            folder = os.path.dirname(os.path.abspath(path)) if path else out
            if not os.path.isdir(folder) and not os.path.join(folder, "").startswith(out):
                raise Failure(INPUT, f"{option} {path}: there is no folder {folder}")
        overwrite.check(outputs, inputs, settings.overwrite)

    def _names(self) -> Iterator[str]:
        return (
            name for mesh in self.meshes.values() for frame in self.frames for name in mesh.names(frame, self.pattern)
        )

    def folders(self) -> list[str]:
        """The folders that files are written to."""
        return sorted({os.path.dirname(name) for name in self._names()})

    def is_current(self, mesh: str, frame: int) -> FrameResult | None:
        """The result of a frame all of whose files are up to date, else None."""
        work = self.meshes[mesh]
        if self.settings.force:
            return None
        # By the names alone, before the pose is read.
        if not all(map(os.path.isfile, work.names(frame, self.pattern))):
            return None
        positions = self.scene.positions(work.shape, frame)
        return work.bake(frame, positions, self.pattern, lambda: None, write=False)

    def bake(self, mesh: str, frame: int, stop: Callable[[], None]) -> FrameResult:
        """Writes what is not up to date of a mesh in a frame."""
        work = self.meshes[mesh]
        result = work.bake(frame, self.scene.positions(work.shape, frame), self.pattern, stop)
        assert result is not None
        return result

    def close(self) -> None:
        """Lets go of everything."""
        for mesh in self.meshes.values():
            mesh.asset.close()
        self.scene.close()
        self.device.close()

    def __enter__(self) -> Work:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
