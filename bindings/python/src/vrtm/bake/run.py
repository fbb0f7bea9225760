"""The course of a bake."""

from __future__ import annotations

import contextlib
import math
import os
import re
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool

from vrtm.bake import basis_maps, carry, cores, dry_run, layer_file, left_out, remarks, report, sheet, staging
from vrtm.bake.console import Console
from vrtm.bake.failure import DEVICE, DONE, SIGNAL, Failure, describe
from vrtm.bake.frames import Frame
from vrtm.bake.left_out import LeftOut
from vrtm.bake.mesh_work import FrameResult
from vrtm.bake.pool import Jobs, Outcome
from vrtm.bake.rows import tile_name
from vrtm.bake.settings import Settings
from vrtm.bake.stopping import Stop
from vrtm.bake.summary import summaries
from vrtm.bake.time_left import TimeLeft
from vrtm.bake.words import counted
from vrtm.bake.work import Work

# A number in a warning, but for a tile's, a layer's and for digits within a name.
_NUMBER = re.compile(r"(?<!tile )(?<!layer )\b\d[\d.]*")
_LOOK = 0.1
"""Seconds between looks at whether a signal came."""
_START = 1.0
"""Seconds that Python and its modules take to start, before a further process opens the scene."""
_SAVED = 0.25
"""By so much further processes are taken to be quicker than one whose solves use all cores, for each doubling of their
number from two on. Two on two cores were measured to save nothing."""

_FRAMES_TOLD = 3
"""Of a warning that names a frame."""

Task = tuple[str, Frame]
"""A mesh's name and a frame."""


def bake(settings: Settings, console: Console, stop: Stop) -> int:
    """Bakes, and returns the exit code. Errors are printed."""
    try:
        failure = _opened(settings, console, stop)
    except Exception as error:
        failure = describe(error)
    console.close()
    if failure is not None:
        console.error(failure.message)
        return failure.code
    return DONE


def _opened(settings: Settings, console: Console, stop: Stop) -> Failure | None:
    start = time.perf_counter()
    console.status(f"opening {settings.scene}")
    # A library that reads it may crash: then the log names it.
    console.verbose(f"opening {settings.scene}")
    warnings: list[str] = []

    def warn(message: str) -> None:
        # Each worker process opens the scene, and its library warns again.
        if message not in warnings:
            warnings.append(message)
            console.warning(message)

    with contextlib.ExitStack() as opened:
        with stop.at_once(console.error):
            work = opened.enter_context(Work(settings, settings.threads))
            opening = time.perf_counter() - start
            work.look_for_gain(stop.check)
            if settings.layer:
                layer_file.check(work)
            if settings.basis:
                basis_maps.check(work)
            carried = carry.Carry(work) if settings.carry_prims else None
            of_layer = layer_file.names(settings)[1:] if settings.layer else ()
            work.check_files(of_layer, carried.files if carried else ())
            for note in [
                *remarks.notes(work),
                *(carried.warnings if carried else ()),
                *(layer_file.foretell(work) if settings.layer else ()),
            ]:
                warn(note)
            for line in left_out.lines(left_out.unmeant(work.left_out)):
                warn(line)
            for line in (
                *remarks.facts(work),
                *remarks.borders(work),
                *remarks.hints(work),
                *(carried.facts() if carried else ()),
            ):
                console.info(line)
            for line in work.told():
                console.verbose(line)
            if not settings.only_layer:
                work.check_units()
            if settings.dry_run:
                for line in [*dry_run.lines(work), *left_out.listed(work.left_out)]:
                    console.info(line)
                return report.strict(settings, work.left_out)
        results: list[FrameResult] = []
        basis, riding, is_new = basis_maps.Made(), [], False
        # Better known now than after hours.
        failure = report.strict(settings, work.left_out)
        if failure is None:
            work.try_folders()
        try:
            if failure is not None:
                raise failure
            beside = [os.path.dirname(path) or "." for path in settings.beside.values()]
            for folder in beside + ([] if settings.only_layer else work.folders()):
                staging.sweep(folder)
            if not settings.only_layer:
                kept = work.remove_idle()
                if kept:
                    more = f" and {len(kept) - 1} others are" if len(kept) > 1 else " is"
                    warn(f"{kept[0]}{more} left there, although nothing is gained: not as vrtm wrote it for the mesh")
                _frames(settings, work, console, stop, results, warn, opening)
            if settings.sheet:
                _sheets(work, console, stop, results)
            failure = report.nothing(results) or report.tolerance(work, results)
            if settings.basis:
                console.status("fitting basis maps")
                basis = basis_maps.write(work, results, stop.check)
                for line in basis.lines:
                    console.info(line)
                failure = failure or basis.failure
            if carried is not None:
                console.status("carrying what is on the skin")
                riding, is_new = carried.write(stop.check, warn)
                for row in riding:
                    console.info(f"{settings.carry_file}: {carry.line(row)}")
            if settings.layer:
                console.status(f"writing {settings.layer}")
                notes, idle = layer_file.write(work)
                for note in notes:
                    warn(note)
                failure = failure or idle
        except Exception as error:
            failure = describe(error)
        late = [entry for result in results for entry in result.left_out]
        for entry in work.scene.said():
            # What a frame that failed, or the layer, has met.
            if isinstance(entry, LeftOut):
                late.append(entry)
            warn(entry.line() if isinstance(entry, LeftOut) else entry)
        missing = left_out.merged([*work.left_out, *late])
        failure = failure or report.strict(settings, missing)
        seconds = time.perf_counter() - start
        if settings.report is not None:
            try:
                report.write(
                    settings.report, report.document(work, results, seconds, failure, warnings, missing, riding)
                )
            except Failure as error:
                if failure is not None:
                    warn(error.message)
                failure = failure or error
    written = sum(result.count("written") for result in results) + basis.written + is_new
    skipped = sum(result.count("skipped") for result in results) + basis.skipped + (bool(riding) and not is_new)
    console.close()
    for _, mesh in summaries(work.meshes, results):
        console.info(mesh.line())
    shown = left_out.listed(missing)
    for line in shown:
        console.info(line)
    if len(missing) >= len(shown):
        # Some are told together, or not at all.
        for entry in missing:
            console.verbose(f"not baked: {entry.line()}")
    if results or failure is None:
        console.info(f"{counted(written, 'file')} written, {skipped} up to date, in {seconds:.1f} s: {settings.out}")
    console.status("done" if failure is None else failure.message.splitlines()[-1])
    return failure


class _Told:
    """What is said of frames as they are done."""

    def __init__(self, work: Work, console: Console, results: list[FrameResult], warn: Callable[[str], None]) -> None:
        self.work, self.console, self.results, self.warn = work, console, results, warn
        self.tiles: set[tuple[str, str]] = set()
        self.kinds: Counter[str] = Counter()
        self.left: TimeLeft | None = None
        self.begun = 0.0

    def begin(self, tasks: list[Task]) -> None:
        """From now on these are done, in the way that the next of them will be."""
        meshes = self.work.meshes
        sizes = {name: 1 + sum(math.prod(tile.cells) for tile in mesh.tiles) for name, mesh in meshes.items()}
        self.left = TimeLeft((mesh for mesh, _ in tasks), sizes)
        self.begun = time.perf_counter()

    def done(self, result: FrameResult) -> None:
        """A frame more is done."""
        self.results.append(result)
        for note in [*result.warnings, *left_out.lines(left_out.unmeant(result.left_out))]:
            # Tears and folds differ from frame to frame in their numbers alone: the first of them are told. A warning
            # of a pose names its frame, and is told for a few.
            kind = _NUMBER.sub("#", note)
            most = _FRAMES_TOLD if ", frame " in note else 1
            self.kinds[kind] += 1
            if self.kinds[kind] <= most:
                self.warn(note)
            elif self.kinds[kind] == most + 1 and most > 1:
                self.warn(f"{note.split(', frame ')[0]}: the same of further frames, which the report names")
        for line in result.told:
            self.console.verbose(line)
        for tile in result.tiles:
            self._tile(result, tile)
        written, skipped = result.count("written"), result.count("skipped")
        what = f"{counted(skipped, 'file')} up to date" if result.tiles else "not baked"
        what = f"{counted(written, 'file')} in {result.milliseconds:.0f} ms" if written else what
        left = ""
        if self.left is not None:
            self.left.done(result.mesh, result.milliseconds / 1e3)
            left = self.left.text(time.perf_counter() - self.begun)
        self.console.done(f"{result.mesh}, frame {result.frame}: {what}{left}")
        for file in (file for part in (result.files, *(tile["files"] for tile in result.tiles)) for file in part):
            self.console.verbose(f"{file['state']}: {os.path.join(self.work.settings.out, file['path'])}")

    def _tile(self, result: FrameResult, tile: dict) -> None:
        name = tile_name(tile)
        if (result.mesh, name) in self.tiles:
            return
        self.tiles.add((result.mesh, name))
        place = f"{self.work.meshes[result.mesh].shape.path} tile {name}"
        self.console.info(f"{place}: {report.shares(tile)}")
        if tile["fixed"] > report.MOSTLY:
            self.warn(
                f"{place}: {tile['fixed']:.0%} of its rigid texels are fixed and stay as they are: "
                f"{report.advice(self.work.meshes[result.mesh].settings, tile)}"
            )


def _frames(
    settings: Settings,
    work: Work,
    console: Console,
    stop: Stop,
    results: list[FrameResult],
    warn: Callable[[str], None],
    opening: float,
) -> None:
    """Bakes all frames. `results` grows as they are done. `opening`: seconds that a scene takes to open. Raises
    Failure."""
    meshes = [name for name, mesh in work.meshes.items() if mesh.gains]
    if settings.warm:
        tasks = [(mesh, frame) for mesh in meshes for frame in work.frames]
    else:
        tasks = [(mesh, frame) for frame in work.frames for mesh in meshes]
    console.start(len(tasks), f"baking {counted(len(tasks), 'frame')}")
    told = _Told(work, console, results, warn)
    current = {}
    for task in tasks:
        stop.check()
        current[task] = work.is_current(*task)
    left = _left(settings, tasks, current)
    for task in tasks:
        result = current[task]
        if task not in left and result is not None:
            told.done(result)
    if left and settings.jobs == 0 and not settings.warm:
        # What one frame costs tells whether further processes are worth their start.
        task = next(iter(left))
        seconds = time.perf_counter()
        _bake(settings, work, [task], (1, settings.threads), stop, told)
        del left[task]
        alone = (time.perf_counter() - seconds) * len(left)
        jobs, threads = cores.split(settings, work, len(left))
        if alone * (1 - 1 / (1 + _SAVED * math.log2(max(jobs, 2) / 2))) < _START + opening:
            jobs, threads = 1, settings.threads
        if left:
            _bake(settings, work, list(left), (jobs, threads), stop, told)
    elif left:
        _bake(settings, work, list(left), cores.split(settings, work, len(left)), stop, told)


def _sheets(work: Work, console: Console, stop: Stop, results: list[FrameResult]) -> None:
    """Draws each mesh in its worst frame. Raises Failure."""
    for name, file in work.sheets().items():
        own = sorted(
            (result for result in results if result.mesh == name and result.tiles), key=lambda result: result.frame
        )
        if own:
            worst = sheet.worst(own)
            positions = work.scene.positions(work.meshes[name].shape, worst.frame)
            drawn = sheet.write(work.meshes[name], worst.frame, positions, file, stop.check)
            console.info(f"{file}: frame {worst.frame}{'' if drawn else ', up to date'}")


def _left(settings: Settings, tasks: list[Task], current: dict[Task, FrameResult | None]) -> dict[Task, None]:
    """The tasks that are to be done, in their order."""
    stale = [task for task in tasks if current[task] is None]
    if settings.warm:
        # Each frame of a mesh starts from the one before it.
        last = {mesh: frame for mesh, frame in stale}
        stale = [(mesh, frame) for mesh, frame in tasks if mesh in last and frame <= last[mesh]]
    return dict.fromkeys(stale)


def _bake(settings: Settings, work: Work, tasks: list[Task], split: tuple[int, int], stop: Stop, told: _Told) -> None:
    """Does tasks with so many jobs and threads. Raises Failure."""
    jobs, threads = split
    told.begin(tasks)
    each = counted(threads, "thread") if threads else "all threads"
    told.console.verbose(f"{counted(len(tasks), 'frame')}, {jobs} at a time, on {each} each")
    with Jobs(settings, work, jobs, threads, stop) as running:
        waiting = running.submit(tasks)
        failure: Failure | None = None
        pending = set(waiting)
        while pending:
            ready, pending = wait(pending, _LOOK, FIRST_COMPLETED)
            for future in ready:
                outcome = _result(future, waiting[future], stop)
                if outcome.result is not None:
                    told.done(outcome.result)
                elif outcome.failure is not None:
                    failure = failure or outcome.failure
            if stop.event.is_set() or failure is not None:
                # What fails is told, not the end of the others that it leads to.
                asked = stop.signal != 0
                running.cancel()
                raise stop.failure() if asked else failure or stop.failure()


def _result(future: Future, task: Task, stop: Stop) -> Outcome:
    mesh, frame = task
    message = f"{mesh}, frame {frame}: a worker process was ended from outside; memory may be short: try fewer --jobs"
    ended = Outcome(failure=Failure(DEVICE, message))
    try:
        outcome = future.result()
        alone = outcome.failure is not None and outcome.failure.code == SIGNAL and not stop.event.is_set()
        return ended if alone else outcome
    except BrokenProcessPool:
        return ended
    except Exception as error:
        return Outcome(failure=describe(error))
