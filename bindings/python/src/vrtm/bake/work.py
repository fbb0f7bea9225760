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


class Work:
    """An open scene and the device. A context manager; not for several threads at once. Raises Failure."""

    def __init__(self, settings: Settings, threads: int) -> None:
        """`threads`: of the library and of image files; 0 = one per core."""
        self.settings = settings
        self._heard: list[str] = []
        # The mesh that is worked on, and the frame.
        self._subject = self._frame = ""
        oiio.attribute("threads", threads)
        try:
            self.device = vrtm.Device(settings.device, adapter=settings.adapter, threads=threads, log=self._hear)
        except vrtm.Error as error:
            # Whatever it is, another machine may have what this one lacks.
            raise Failure(DEVICE, f"--device {settings.device}: {one_line(error)}") from error
        self.scene = Scene(settings.scene, settings.options)
        if not self.scene.shapes:
            raise Failure(INPUT, f"{settings.scene}: no mesh with UVs")
        copies = warped.listed(settings.textures, settings.normal_maps, settings.normal_y == "down")
        self.meshes = {shape.name: self._mesh(shape, copies) for shape in self.scene.shapes}
        self.frames, self.missing_frames = frames.clamp(settings.frames, self.scene.frames)
        if not self.frames:
            there = frames.text(self.scene.frames)
            raise Failure(INPUT, f"--frames: none of these is in {settings.scene}, which has {there or 'none'}")
        self.pattern = self._pattern(copies)

    def _hear(self, level: str, message: str) -> None:
        """The library's log."""
        if level == "warning":
            # What it says of a pose is said of a frame.
            frame = self._frame if message.startswith("pose") else ""
            self._heard.append(": ".join(filter(None, [self._subject + frame, message])))

    def heard(self) -> list[str]:
        """What the library warned of since this was asked last, each as a sentence that names the mesh."""
        heard, self._heard = self._heard, []
        return heard

    def _mesh(self, shape: Shape, copies: tuple[warped.Copy, ...]) -> MeshWork:
        self._subject, self._frame = shape.path, ""
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
        """What is odd about the scene and the options, each as a sentence. Raises Failure if it must not be odd."""
        notes = [*self.heard(), *self.scene.warnings, *self._without_maps()]
        if self.missing_frames:
            notes.append(
                f"--frames: {self.settings.scene} has {frames.text(self.scene.frames)}, without "
                f"{frames.text(self.missing_frames)}, which are left out"
            )
        missing = unknown_tiles(self.settings, list(self.meshes.values()))
        if missing:
            notes.append(f"--tiles: no mesh has {', '.join(map(str, missing))}")
        return notes

    def _without_maps(self) -> list[str]:
        notes = []
        for option, then in (("rigidity", "nothing keeps its shape there"), ("mask", "all may move there")):
            meshes = [(mesh.shape.path, mesh.without(option)) for mesh in self.meshes.values()]
            found = "; ".join(f"{path} {', '.join(map(str, udims))}" for path, udims in meshes if udims)
            if found:
                named, what = ("", "no map") if getattr(self.settings, option) else ("-primvar", "no values")
                notes.append(f"--{option}{named}: {what} for {found}: {then}")
                if self.settings.strict and option == "rigidity":
                    raise Failure(INPUT, notes[-1])
        black = [path for mesh in self.meshes.values() for path in mesh.black]
        return [*notes, *(f"--rigidity: {path} is black all over: nothing keeps its shape there" for path in black)]

    def check_files(self) -> None:
        """Raises Conflict if a file cannot be written without the loss of another, Failure if a folder is missing."""
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
        for name in (settings.out, settings.layer, settings.report):
            # Raises UnicodeEncodeError for what is no UTF-8.
            (name or "").encode()
        out = os.path.join(os.path.abspath(settings.out), "")
        for option, path in (("--layer", settings.layer), ("--report", settings.report)):
            folder = os.path.dirname(os.path.abspath(path)) if path else out
            if not os.path.exists(folder) and not os.path.join(folder, "").startswith(out):
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
        self._subject, self._frame = work.shape.path, f", frame {frame}"
        result = work.bake(frame, self.scene.positions(work.shape, frame), self.pattern, stop)
        assert result is not None
        result.warnings += self.heard()
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
