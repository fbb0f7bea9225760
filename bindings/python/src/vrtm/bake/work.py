"""A scene with its meshes, opened for baking: what the main process checks with, and what each worker bakes with."""

import contextlib
import dataclasses
import functools
import itertools
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import OpenImageIO as oiio

import vrtm
from vrtm.bake import borders, frames, gain, image_file, not_baked, overwrite, sheet, staging, units, warped
from vrtm.bake.failure import DEVICE, DONE, INPUT, Failure, describe, one_line, unwritable
from vrtm.bake.fingerprint import Fingerprint
from vrtm.bake.frames import Frame
from vrtm.bake.left_out import LeftOut
from vrtm.bake.mesh_work import FrameResult, MeshWork
from vrtm.bake.names import ONE_MESH, SEVERAL, Pattern
from vrtm.bake.neighbours import Neighbours
from vrtm.bake.outputs import frame_name
from vrtm.bake.part import Given, Part
from vrtm.bake.scene import Scene, SceneError, Shape
from vrtm.bake.scene.topology import outside
from vrtm.bake.settings import Borders, Settings
from vrtm.bake.words import others
from vrtm.basis.stored import ending

_MOST_BYTES = 256 << 20
"""If all tiles together take more, their solvers' memory is given back tile by tile, and allocated in each frame."""


@dataclass(frozen=True)
class Choices:
    """Choices for the meshes, by their names. Picklable."""

    borders: dict[str, Borders]
    idle: dict[str, dict[gain.Group, str]]
    """Parts and layers without a gain."""


class Work(contextlib.AbstractContextManager):
    """An open scene and the device. A context manager; not for several threads at once. Raises Failure."""

    def __init__(self, settings: Settings, threads: int, choices: Choices | None = None) -> None:
        """`threads`: of the library and of image files; 0 = one per core. `choices`: of another process."""
        self.settings = settings
        self._heard: list[str] = []
        self._told: list[str] = []
        # The mesh that is worked on, and the frame.
        self._subject = self._frame = ""
        self._shape: Shape | None = None
        self._poses: dict[str, list[str]] = {}
        oiio.attribute("threads", threads)
        self.device = self._opened_device(threads)
        self.scene = Scene(settings.scene, settings.options)
        self.frames, self.missing_frames = self._present_frames()
        self.units: dict[str, tuple[units.Units, units.Finding]] = {}
        """Of the meshes, by name, with what was found of all of their frames."""
        self._every_shape = [self._in_units(shape) for shape in self.scene.shapes]
        self.shapes = [shape for shape in self._every_shape if not self._stays(shape)]
        """The meshes to bake: those that deform, and those that are named."""
        still = [shape.path for shape in self._every_shape if shape not in self.shapes]
        self._check_shapes(still)
        copies = warped.listed(settings.textures, settings.normal_maps, settings.normal_y == "down")
        known = {} if choices is None else choices.borders
        self.meshes: dict[str, MeshWork] = {}
        unusable = list(self._make(copies, known))
        self.shapes = [shape for shape in self.shapes if shape.name in self.meshes]
        self.left_out = [*self._known_left_out(still), *unusable]
        """All that is known not to be baked."""
        self.pattern = self._pattern(copies)
        self.idle: dict[str, dict[gain.Group, str]] = {}
        """Parts and layers without a gain, by the mesh's name."""
        # Without --measure, for the last lines of the bake alone.
        self._measured = {self.frames[k * (len(self.frames) - 1) // 4] for k in (1, 2, 4)}
        if choices is not None:
            self.leave_out(choices.idle)

    def _opened_device(self, threads: int) -> vrtm.Device:
        settings = self.settings
        try:
            return vrtm.Device(settings.device, adapter=settings.adapter, threads=threads, log=self._hear)
        except vrtm.Error as error:
            # Whatever it is, another machine may have what this one lacks.
            raise Failure(DEVICE, f"--device {settings.device}: {one_line(error)}") from error

    def _present_frames(self) -> tuple[tuple[Frame, ...], tuple[Frame, ...]]:
        """The frames to bake, and those of --frames that the scene lacks. Raises Failure."""
        settings, scene = self.settings, self.scene
        try:
            found, missing = frames.clamp(settings.frames, scene.frames, scene.has_subframes)
        except ValueError as error:
            raise Failure(INPUT, f"{settings.scene}: {error}") from None
        if not found:
            there = frames.text(scene.frames)
            raise Failure(INPUT, f"--frames: none of these is in {settings.scene}, which has {there or 'none'}")
        if settings.freeze is not None and settings.freeze not in found:
            raise Failure(INPUT, f"--freeze {settings.freeze}: it is none of {frames.text(found)}")
        if settings.task is not None:
            number, count = settings.task
            found = found[len(found) * (number - 1) // count : len(found) * number // count]
            if not found:
                raise Failure(DONE, f"--task {number}/{count}: no frame is left for it")
        return found, missing

    def lacking(self) -> str:
        """The frames of the scene that are not of this bake, as the beginning of a sentence; empty if there are
        none."""
        there = self.scene.frames
        lacks = len(there) - sum(isinstance(frame, int) and frame in there for frame in self.frames)
        if not lacks:
            return ""
        # A list of very many is not readable.
        listed = frames.text(set(there) - set(self.frames)) if len(there) <= frames.MOST else ""
        return f"{f'frames {listed}' if listed else f'{lacks} frames'} of the scene are not in it"

    def _check_shapes(self, still: Sequence[str]) -> None:
        """Raises Failure if no mesh is left to bake, or none has the subsets that are asked for. `still`: the paths of
        meshes that do not deform."""
        scene = self.settings.scene
        if not self.shapes:
            named = f"{still[0]}{others(len(still) - 1)}"
            told = [warning for warning in self.scene.warnings if warning.startswith(tuple(f"{p}: " for p in still))]
            message = f"{scene}: nothing deforms: {named} can be baked if --meshes names it"
            raise Failure(INPUT, "; ".join([message, *told]))
        if self.settings.subsets and not any(shape.subsets for shape in self.shapes):
            raise Failure(INPUT, f"--subsets: no mesh of {scene} has subsets that materials can be bound to")

    def _known_left_out(self, still: Sequence[str]) -> list[LeftOut]:
        return [
            # Of the ends of its range that are no frames, those that --frames leaves to the scene.
            *(entry for entry in self.scene.left_out if not entry.frames or self.settings.frames is None),
            *(LeftOut("nothing deforms there; --meshes can name it", path, meant=True) for path in still),
            *not_baked.of_frames(self.settings, self.scene.frames, self.missing_frames),
            *not_baked.of_meshes(self.settings, self.meshes.values()),
        ]

    def _hear(self, entry: vrtm.LogEntry) -> None:
        """The library's log."""
        if entry.code in ("rigidity_range", "mask_range"):
            # The notes say it with the name of the file.
            return
        message = entry.message
        if self._shape is not None and entry.code == "faces_outside":
            message = f"{message}: {outside(self._shape.uvs, self._shape.uv_indices)}"
        # What it says of a pose is said of a frame.
        frame = self._frame if entry.code in ("pose_scale", "pose_order") else ""
        line = ": ".join(filter(None, [self._subject + frame, message]))
        (self._heard if entry.level == "warning" else self._told).append(line)

    def told(self) -> list[str]:
        """Details of the library since the last call."""
        told, self._told = self._told, []
        return told

    def _stays(self, shape: Shape) -> bool:
        """True if a mesh is at rest in all frames, so that its maps would be the identity, and is not named."""
        if not shape.still or self.settings.options.names(shape.path):
            return False
        pose = self.scene.positions(shape, self.frames[0])
        if shape.rest is self.scene.shape(shape.name).rest:
            return np.array_equal(pose, shape.rest)
        # A factor is known to some digits.
        return np.allclose(pose, shape.rest, rtol=1e-5, atol=1e-5 * np.ptp(shape.rest, axis=0).max(initial=0))

    def _in_units(self, shape: Shape) -> Shape:
        """The shape with its rest in the units of its poses."""
        if self.settings.allow_units or self.settings.scale == "follow":
            return shape
        ruler = units.Units(shape, self.scene.frames, lambda frame: self.scene.positions(shape, frame))
        finding = ruler.finding()
        self.units[shape.name] = ruler, finding
        if finding.factor == 1:
            return shape
        rest_from = f"{shape.rest_from}, {finding.factor:.6g} times as large {finding.reason}"
        return dataclasses.replace(shape, rest=shape.rest * finding.factor, rest_from=rest_from)

    def heard(self) -> list[str]:
        """Warnings of the library since the last call, as sentences that name the mesh."""
        heard, self._heard = self._heard, []
        return heard

    def _make(self, copies: tuple[warped.Copy, ...], known: dict[str, Borders]) -> Iterator[LeftOut]:
        """Makes `meshes`, without those that the library cannot take. Raises Failure for one that is named, and for the
        last one if there is no other."""
        for shape in self.shapes:
            try:
                self.meshes[shape.name] = self._mesh(shape, copies, known.get(shape.name))
            except Failure as failure:
                is_last = shape is self.shapes[-1] and not self.meshes
                if failure.code != INPUT or is_last or self.settings.options.names(shape.path):
                    raise
                why = failure.message.removeprefix(f"{self.settings.scene} {shape.path}: ")
                yield LeftOut(f"cannot be baked: {why}", shape.path)

    def _mesh(self, shape: Shape, copies: tuple[warped.Copy, ...], known: Borders | None) -> MeshWork:
        self._subject, self._frame, self._shape = shape.path, "", shape
        try:
            given = Given(self.settings, shape, self.device, copies)
            if known is not None:
                return MeshWork(given, known)
            return borders.mesh(given, self.scene, lambda: self._neighbours)
        except (vrtm.Error, ValueError) as error:
            raise describe(error, f"{self.settings.scene} {shape.path}") from error

    @functools.cached_property
    def _neighbours(self) -> Neighbours:
        return Neighbours(self.scene, self._every_shape)

    def _pattern(self, copies: tuple[warped.Copy, ...]) -> Pattern:
        several = len(self.shapes) > 1
        # Not by the frames and tiles of this call: another task may write the others.
        counts = {
            "<mesh>": len(self.shapes),
            "<kind>": len(next(iter(self.meshes.values())).listed) + len(copies) + self.settings.basis,
            "<frame>": len(self.frames),
            "<UDIM>": max(len(mesh.all_udims) for mesh in self.meshes.values()),
        }
        text = SEVERAL if several else ONE_MESH
        if self.settings.subsets:
            counts["<subset>"] = max(len(mesh.parts) for mesh in self.meshes.values())
            text = text.replace("<kind>", "<subset>.<kind>")
        return Pattern(self.settings.name or text, counts)

    def look_for_gain(self, stop: Callable[[], None]) -> None:
        """Looks at all poses for what gains nothing, which is left out, unless --meshes names it."""
        settings = self.settings
        # Maps of UVs of another set are none of the identity; and between two frames what turns rigidly shrinks.
        if settings.options.texture_uv is not None or not all(isinstance(frame, int) for frame in self.frames):
            return
        if len(self.scene.frames) > frames.MOST:
            # To look at so many would take too long.
            return
        every = sorted({*self.scene.frames, *self.frames})
        for mesh in self.meshes.values():
            if settings.options.names(mesh.shape.path):
                continue
            pose = functools.partial(self.scene.positions, mesh.shape)
            idle = gain.without_gain(mesh.shape, mesh.parts, every, pose, stop)
            if idle:
                self.idle[mesh.shape.name] = idle
                self.left_out += not_baked.without_gain(mesh, idle)
        self.leave_out(self.idle)

    def leave_out(self, idle: dict[str, dict[gain.Group, str]]) -> None:
        """Leaves parts and layers without a gain out of the bake."""
        for name, groups in idle.items():
            self.meshes[name].leave_out(groups)

    def remove_idle(self) -> list[str]:
        """Removes files of earlier bakes of what gains nothing now; returns those that could not be."""
        return [path for mesh, path in self._idle_names() if not image_file.remove(path, mesh)]

    def _idle_names(self) -> Iterator[tuple[str, str]]:
        """The mesh and the path of all files that are not written, since nothing is gained."""
        for mesh in (mesh for mesh in self.meshes.values() if mesh.idle):
            for frame in self.frames:
                yield from ((mesh.shape.name, name) for name in mesh.idle_names(frame, self.pattern))

    @property
    def choices(self) -> Choices:
        """Findings that a further process need not repeat."""
        return Choices({name: mesh.borders for name, mesh in self.meshes.items()}, self.idle)

    @property
    def parts(self) -> list[Part]:
        """The parts of all meshes, each of which is baked by itself."""
        return [part for mesh in self.meshes.values() for part in mesh.parts]

    def check_units(self) -> None:
        """Raises Failure if a mesh has other units in the first frame than at rest, and nothing tells which."""
        for mesh in self.meshes.values():
            _, found = self.units.get(mesh.shape.name, (None, units.Finding()))
            if found.ends:
                raise Failure(INPUT, f"{self.settings.scene} {mesh.shape.path}: {found.warning}")
            with contextlib.suppress(SceneError):
                # A wrong pose is reported when its frame is baked.
                self._check_units(mesh.shape, self.frames[0], self.scene.positions(mesh.shape, self.frames[0]))

    def _check_units(self, shape: Shape, frame: Frame, positions: np.ndarray) -> list[str]:
        if shape.name not in self.units:
            return []
        found = self.units[shape.name][0].jump(frame, positions)
        if found.ends:
            raise Failure(INPUT, f"{self.settings.scene} {shape.path}, frame {frame}: {found.warning}")
        return [f"{shape.path}, frame {frame}: {found.warning}"] if found.warning else []

    def replaced(self, fact: str) -> Iterator[tuple[str, object]]:
        """The redirection maps that are there, and what each tells of itself."""
        for mesh in self.meshes.values() if not self.settings.only_layer else ():
            for tile in mesh.tiles:
                for frame in self.frames:
                    name = mesh.path(self.pattern, "redirect", frame, tile)
                    found = image_file.told(name)
                    if fact in found:
                        yield name, found[fact]

    def check_files(self, of_layer: Sequence[str] = (), of_carry: Sequence[str] = ()) -> None:
        """Raises Conflict if a file cannot be written without the loss of another, Failure if a folder is missing.
        `of_layer`: files written beside the layer; `of_carry`: files read for geometry on the surface."""
        settings = self.settings
        for name in (settings.out, *settings.beside.values()):
            # Raises UnicodeEncodeError for what is no UTF-8.
            name.encode()
        out = os.path.join(os.path.abspath(settings.out), "")
        for option, path in settings.beside.items():
            folder = os.path.dirname(os.path.abspath(path))
            if not os.path.exists(folder) and not os.path.join(folder, "").startswith(out):
                raise Failure(INPUT, f"{option} {path}: there is no folder {folder}")
        overwrite.check(self._outputs(of_layer), self._inputs(of_carry), settings.overwrite)
        names = {mesh.shape.name for mesh in self.meshes.values()}
        for path, mesh in self.replaced("vrtm:mesh"):
            if mesh not in names and not settings.overwrite:
                told = f"--out: {path} holds the maps of the mesh {mesh}: --overwrite replaces them"
                raise Failure(INPUT, f"{told}, and --name with <mesh> keeps both")

    def _outputs(self, of_layer: Sequence[str]) -> list[tuple[str, str]]:
        """All files to be written, with their options."""
        # Files that are there without a gain are removed, or wrong.
        there = [name for _, name in self._idle_names() if os.path.lexists(name)]
        return [
            *((name, "--out") for name in ([] if self.settings.only_layer else [*self._names(), *there])),
            *((path, "--sheet") for path in self.sheets().values()),
            *((path, "--layer") for path in of_layer),
            *((path, option) for option, path in self.settings.beside.items()),
        ]

    def _inputs(self, of_carry: Sequence[str]) -> list[tuple[str, str]]:
        """All files that are read, and the log, which is open, each in a word."""
        settings = self.settings
        inputs = [(settings.scene, "the scene")]
        for part in self.parts:
            inputs += [(path, f"--{option}") for option, paths in part.maps.items() for path in paths.values()]
            inputs += [(path, "--texture") for _, paths in part.textures for path in paths.values()]
        inputs += [(path, "a file of the scene") for path in self.scene.files]
        inputs += [(path, "a file of --carry") for path in of_carry]
        further = {"--controls": settings.controls, "--carry": settings.carry, "--log": settings.log}
        return inputs + [(path, option) for option, path in further.items() if path is not None]

    def _names(self) -> Iterator[str]:
        yield from self.carried_files()
        for mesh in self.meshes.values():
            for frame in self.frames:
                yield from mesh.names(frame, self.pattern)
            if self.settings.basis and mesh.gains:
                yield self.basis_file(mesh.shape.name)
                yield from self.geometry_files(mesh.shape.name).values()
                # There may be as many basis maps as frames.
                for tile, k in itertools.product(mesh.tiles, range(len(self.frames))):
                    yield mesh.path(self.pattern, "basis", k, tile, ending=ending(self.settings.basis_format))

    def carried_files(self) -> list[str]:
        """The file with what is carried; in a task of a farm, those of its frames."""
        whole = self.settings.carry_file
        if whole is None or self.settings.task is None:
            return [] if whole is None else [whole]
        return [self.carried_file(mesh, frame) for mesh in self.meshes for frame in self.frames]

    def carried_file(self, mesh: str, frame: Frame) -> str:
        return os.path.join(self.settings.out, frame_name(self.pattern, mesh, frame, "carried", ".tif"))

    def basis_file(self, mesh: str, ending: str = ".json") -> str:
        """The path of a mesh's weights of basis maps, or of its morph targets."""
        return os.path.join(self.settings.out, (f"{mesh}." if len(self.shapes) > 1 else "") + f"basis{ending}")

    def geometry_files(self, mesh: str) -> dict[str, str]:
        """The files of a mesh with its morph targets, by their kind."""
        asked = {"gltf": (self.settings.gltf, ".glb"), "blend_shapes": (self.settings.blend_shapes, ".usdc")}
        return {kind: self.basis_file(mesh, ending) for kind, (wanted, ending) in asked.items() if wanted}

    def sheets(self) -> dict[str, str]:
        """The file of each mesh's sheet, if sheets are to be drawn."""
        several = len(self.meshes) > 1
        return {name: sheet.path(self.settings, name, several) for name in self.meshes if self.settings.sheet}

    def folders(self) -> list[str]:
        return sorted({os.path.dirname(name) for name in self._names()})

    def try_folders(self) -> None:
        """Raises Failure if a folder cannot be written to. Missing ones are made."""
        settings = self.settings
        places = [] if settings.only_layer else [("--out", name) for name in self.folders()]
        places += [(option, os.path.dirname(path) or ".") for option, path in settings.beside.items()]
        for option, folder in places:
            try:
                staging.try_folder(folder)
            except OSError as error:
                raise unwritable(f"{option}: {folder}", error) from error

    def _positions(self, work: MeshWork, frame: Frame) -> tuple[np.ndarray, str]:
        """The pose of a mesh, and a hash of it, with what was before it where frames start from those before them."""
        positions = self.scene.positions(work.shape, frame)
        if not self.settings.warm:
            return positions, Fingerprint().array(positions).hex()
        known = self._poses.setdefault(work.shape.name, [])
        for earlier in itertools.islice(self.frames, len(known), self.frames.index(frame) + 1):
            try:
                own = positions if earlier == frame else self.scene.positions(work.shape, earlier)
            except SceneError:
                # It is left out, and the next one starts from the one before it.
                own = None
            known.append(Fingerprint().text(*known[-1:]).array(own).hex())
        return positions, known[self.frames.index(frame)]

    @functools.cached_property
    def bytes(self) -> int:
        """Bytes of a job for all of its tiles, less the scene."""
        needs = [tile.tile.estimate() for mesh in self.meshes.values() for tile in mesh.tiles]
        kept = sum(need.solving_bytes for need in needs)
        if len(needs) < 2 or kept <= _MOST_BYTES:
            return kept
        for mesh in self.meshes.values():
            mesh.releases = True
        prepared = sum(need.prepared_bytes for need in needs)
        return prepared + max(need.solving_bytes - need.prepared_bytes for need in needs)

    def is_current(self, mesh: str, frame: Frame) -> FrameResult | None:
        """The result of a frame all of whose files are up to date, else None."""
        work = self.meshes[mesh]
        # Missing files show without reading the pose.
        if not all(map(os.path.isfile, work.names(frame, self.pattern))):
            return None
        try:
            return work.bake(frame, *self._positions(work, frame), self.pattern, lambda: None, write=False)
        except SceneError:
            # `bake` says what is wrong with the pose.
            return None

    def bake(self, mesh: str, frame: Frame, stop: Callable[[], None]) -> FrameResult:
        """Writes what is not up to date of a mesh in a frame."""
        work = self.meshes[mesh]
        self._subject, self._frame = work.shape.path, f", frame {frame}"
        notes: list[str] = []
        try:
            positions, pose = self._positions(work, frame)
            notes = self._check_units(work.shape, frame, positions)
            _ = self.bytes
            result = work.bake(frame, positions, pose, self.pattern, stop, measure=frame in self._measured)
            assert result is not None
        except SceneError as error:
            # One pose that cannot be used is no reason to leave out those after it.
            why = one_line(error).removeprefix(f"{self.settings.scene} {work.shape.path}: ")
            result = FrameResult(mesh, frame, left_out=[LeftOut(why, work.shape.path, (frame,))])
        result.warnings += [*notes, *self.heard()]
        for entry in self.scene.said():
            (result.left_out if isinstance(entry, LeftOut) else result.warnings).append(entry)
        result.told += self.told()
        return result

    def close(self) -> None:
        for mesh in self.meshes.values():
            mesh.close()
        self.scene.close()
        self.device.close()

    def __exit__(self, *_: object) -> None:
        self.close()
