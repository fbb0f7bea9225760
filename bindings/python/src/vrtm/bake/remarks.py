"""All that a bake prints and logs: about the scene when it is open, about each frame, and at the end."""

import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from vrtm.bake import carry, frames, layer_file, left_out, pool, report, rows
from vrtm.bake.console import Console
from vrtm.bake.left_out import LeftOut
from vrtm.bake.mesh_work import FrameResult
from vrtm.bake.part import Part
from vrtm.bake.report import summaries
from vrtm.bake.scene.types import frame_number
from vrtm.bake.words import counted, numbered, others
from vrtm.bake.work import Work

# A number in a warning, but for a tile's, a layer's and for digits within a name.
_NUMBER = re.compile(r"(?<!tile )(?<!layer )\b\d[\d.]*")
_FRAMES_TOLD = 3
"""Frames for which a warning that names them is printed."""


class Remarks:
    """The messages of a bake, on its console. `warnings`: all warnings, each once, for the report."""

    def __init__(self, console: Console) -> None:
        self.console = console
        self.warnings: list[str] = []
        self._tiles: set[tuple[str, str]] = set()
        self._kinds: Counter[str] = Counter()

    def warn(self, *messages: str) -> None:
        for message in messages:
            # Each worker process opens the scene, and its library warns again.
            if message not in self.warnings:
                self.warnings.append(message)
                self.console.warning(message)

    def info(self, *messages: str) -> None:
        for message in messages:
            self.console.info(message)

    def opened(self, work: Work, carried: carry.Carry | None) -> None:
        """The scene is open and checked."""
        self.warn(*notes(work), *(carried.warnings if carried else ()))
        self.warn(*left_out.lines(left_out.unmeant(work.left_out)))
        self.info(*facts(work), *borders(work), *hints(work), *(carried.facts() if carried else ()))
        for line in work.told():
            self.console.verbose(line)

    def idle_files(self, kept: Sequence[str]) -> None:
        """Files of earlier bakes without a gain are left in place."""
        if kept:
            more = f" and {len(kept) - 1} others are" if len(kept) > 1 else " is"
            self.warn(f"{kept[0]}{more} left there, although nothing is gained: not as vrtm wrote it for the mesh")

    def begun(self, frames: int, jobs: int, threads: int) -> None:
        """So many frames begin, in jobs of so many threads."""
        each = counted(threads, "thread") if threads else "all threads"
        self.console.verbose(f"{counted(frames, 'frame')}, {jobs} at a time, on {each} each")

    def done(self, work: Work, result: FrameResult) -> None:
        """A frame is done."""
        for note in [*result.warnings, *left_out.lines(left_out.unmeant(result.left_out))]:
            # Tears and folds differ from frame to frame in their numbers alone: the first of them are told. A warning
            # of a pose names its frame, and is told for a few.
            kind = _NUMBER.sub("#", note)
            most = _FRAMES_TOLD if ", frame " in note else 1
            self._kinds[kind] += 1
            if self._kinds[kind] <= most:
                self.warn(note)
            elif self._kinds[kind] == most + 1 and most > 1:
                self.warn(f"{note.split(', frame ')[0]}: the same of further frames, which the report names")
        for line in result.told:
            self.console.verbose(line)
        for tile in result.tiles:
            self._tile(work, result, tile)
        written, skipped = result.count("written"), result.count("skipped")
        done = f"{counted(skipped, 'file')} up to date" if result.tiles else "not baked"
        done = f"{counted(written, 'file')} in {result.milliseconds:.0f} ms" if written else done
        self.console.done(f"{result.mesh}, frame {result.frame}: {done}")
        for file in result.every_file:
            self.console.verbose(f"{file['state']}: {os.path.join(work.settings.out, file['path'])}")

    def _tile(self, work: Work, result: FrameResult, tile: dict) -> None:
        name, mesh = rows.tile_name(tile), work.meshes[result.mesh]
        if (result.mesh, name) in self._tiles:
            return
        self._tiles.add((result.mesh, name))
        place = f"{mesh.shape.path} tile {name}"
        self.info(f"{place}: {report.shares(tile)}")
        if tile["fixed"] > report.MOSTLY:
            told = f"{tile['fixed']:.0%} of its rigid texels are fixed and stay as they are"
            self.warn(f"{place}: {told}: {report.advice(mesh.settings, tile)}")

    def ended(self, work: Work, results: Sequence[FrameResult], missing: Sequence[LeftOut]) -> None:
        """All files are written, as far as they can be."""
        self.console.close()
        self.info(*(mesh.line() for _, mesh in summaries(work.meshes, results)))
        shown = left_out.listed(missing)
        self.info(*shown)
        # Some are told together, or not at all.
        for entry in missing if len(missing) >= len(shown) else ():
            self.console.verbose(f"not baked: {entry.line()}")


def notes(work: Work) -> list[str]:
    """Warnings about odd scenes and options."""
    notes = [*work.heard(), *work.scene.warnings, *_without_maps(work)]
    found = [(shape.path, work.units[shape.name][1]) for shape in work.shapes if shape.name in work.units]
    notes += [f"{path}: {finding.warning}" for path, finding in found if finding.warning and not finding.ends]
    settings, there = work.settings, work.scene.frames
    rest = settings.options.rest or ""
    if rest.startswith("frame:") and not there[0] <= frame_number(rest) <= there[-1]:
        notes.append(f"--rest {rest}: {settings.scene} has the frames {frames.text(there)}")
    if settings.only_layer and settings.limits:
        notes.append(f"--only-layer solves nothing: {', '.join(settings.limits)} cannot be checked")
    if settings.half and settings.form != "delta":
        notes.append("--half: numbers of 16 bits are off by a texel of a texture of 4096, but for --form delta")
    for part in work.parts:
        for copy, paths in part.textures:
            lacking = [udim for udim in part.udims if udim not in paths]
            if paths and lacking:
                notes.append(f"{part.where}: {copy.pattern} has no file of {numbered('tile', lacking)}")
    other = [path for path, form in work.replaced("vrtm:form") if form != settings.form]
    if other:
        told = f"{len(other)} maps of another form, such as {other[0]}, are replaced by ones of form {settings.form}"
        notes.append(f"{told}: layers that name them have to be written again")
    return notes


def _without_maps(work: Work) -> list[str]:
    notes = []
    what = "no map of --mask" if work.settings.mask else "no values of --mask-primvar"
    for part in work.parts:
        udims = part.without("mask")
        if udims:
            notes.append(f"{part.where}: {what} for {numbered('tile', udims)}: all may move there")
        notes += [f"{part.where}: {note}" for note in part.notes]
    return notes


def hints(work: Work) -> list[str]:
    """Hints about options that may be meant or not."""
    hints = []
    for option in ("rigidity", "mask"):
        pattern = getattr(work.settings, option)
        users = _grouped((path, part.where) for part in work.parts if pattern for path in part.maps[option].values())
        shared = next(((path, meshes) for path, meshes in users.items() if len(meshes) > 1), None)
        if shared:
            path, (first, second, *more) = shared
            placeholder = "<subset>" if work.settings.subsets and "<subset>" not in pattern else "<mesh>"
            hints.append(
                f"{first}, {second}{others(len(more))} share {path}: with {placeholder} in --{option} each has its own"
            )
    for scheme, (first, *more) in _grouped((shape.scheme, shape.path) for shape in work.shapes if shape.scheme).items():
        then = "--subdivide 2 refines it" if scheme == "catmullClark" else "its scheme cannot be refined"
        where = f"{first}{others(len(more))}"
        hints.append(f"{where}: renderers smooth this subdivision surface ({scheme}), and its cage is baked: {then}")
    for mesh in work.meshes.values() if not work.settings.layer else ():
        most = max((tile.tile.layers for tile in mesh.tiles), default=1)
        if most > 1:
            told = f"its UVs lie over one another in {most} layers, each of which has maps of its own"
            hints.append(f"{mesh.shape.path}: {told}: --layer writes which faces take which")
    return hints


def facts(work: Work) -> list[str]:
    """Choices that the bake made for the user: the device, and rest poses."""
    info = work.device.info
    threads = f", {info.threads} threads" if info.backend == "cpu" else ""
    lines = [f"device: {info.backend}, {info.name}{threads}{f' ({info.reason})' if info.reason else ''}"]
    lines += [f"frames: {work.scene.rate}"] if work.scene.rate else []
    sets = _grouped((shape.uv_name, shape.path) for shape in work.shapes)
    for uv, (first, *more) in sets.items() if len(sets) > 1 else ():
        lines.append(f"UV set: {uv}: {first}{others(len(more))}")
    for rest, (first, *more) in _grouped((shape.rest_from, shape.path) for shape in work.shapes).items():
        lines.append(f"rest: {rest}" if rest == first else f"rest: {rest}: {first}{others(len(more))}")
    return lines


def borders(work: Work) -> list[str]:
    """The choices at borders, and their reasons."""
    every = ((mesh.borders, mesh.shape.path) for mesh in work.meshes.values())
    told = ((f"seams {of.seams}, open borders {of.open_borders}: {of.why}", path) for of, path in every if of.why)
    return [f"{first}{others(len(more))}: {line}" for line, (first, *more) in _grouped(told).items()]


def _grouped(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """The second parts of pairs, by the first."""
    found: dict[str, list[str]] = {}
    for key, value in pairs:
        found.setdefault(key, []).append(value)
    return found


def planned(work: Work) -> Iterator[str]:
    """Meshes, tiles, maps, files and memory. Nothing is prepared, solved or written."""
    settings = work.settings
    yield f"frames: {frames.text(work.frames)} of {frames.text(work.scene.frames)}"
    for mesh in work.meshes.values():
        shape = mesh.shape
        name = f" as {shape.name}" if len(work.meshes) > 1 else ""
        yield f"{shape.path}{name}: UV set {shape.uv_name}, {len(shape.rest)} vertices, rest: {shape.rest_from}"
        for tile in mesh.tiles:
            needs = tile.tile.estimate()
            grid, size = (f"{a} x {b}" for a, b in (tile.cells, tile.size))
            size = size if tile.size[0] else "auto"
            maps = ", ".join(_maps(tile.part, tile.udim))
            share = needs.movable_nodes / ((tile.cells[0] + 1) * (tile.cells[1] + 1))
            needed = f"; {share:.1%} may move; {_mb(needs.solving_bytes)}"
            if settings.is_unpainted:
                # Its maps will tell.
                grid, needed = grid if settings.size else "by the features", ""
                size = size if settings.size or settings.map_size else "as the rigidity map"
            yield f"  tile {rows.tile_name(rows.place(tile))}: grid {grid}, maps {size}, {maps}{needed}"
    names = [name for mesh in work.meshes.values() for frame in work.frames for name in mesh.names(frame, work.pattern)]
    there = sum(map(os.path.exists, names))
    if names and not settings.only_layer:
        yield f"files: {len(names)} below {settings.out}, {there} of which are there: {names[0]} to {names[-1]}"
    for path in layer_file.names(settings) if "--layer" in settings.beside else ():
        yield f"layer: {path}"
    yield from (f"carried: {path}" for path in work.carried_files())
    yield from (f"sheet: {path}" for path in work.sheets().values())
    for what in ("root", "report", "log"):
        path = getattr(settings, what)
        yield from [f"{what}: {path}"] if path else []
    if settings.is_unpainted:
        return
    jobs, threads = pool.split(settings, work, len(work.frames) * len(work.meshes))
    most = f"{counted(jobs, 'job')} of {counted(threads, 'thread')}"
    yield f"memory: {_mb(work.bytes)} per job, besides the scene; at most {most}"


def _maps(part: Part, udim: int) -> Iterator[str]:
    for option in ("rigidity", "mask"):
        path = part.maps[option].get(udim)
        if path is not None:
            yield f"{option} {path}"
        elif getattr(part.shape, f"vertex_{option}") is not None:
            yield f"{option} per vertex"
        elif option == "rigidity":
            yield "no rigidity"
    for copy, paths in part.textures:
        if udim in paths:
            yield f"{copy.kind} {paths[udim]}"


def _mb(count: int) -> str:
    return f"{count / 1e6:.0f} MB"
