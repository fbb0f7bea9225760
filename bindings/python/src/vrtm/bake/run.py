"""The course of a bake."""

import contextlib
import functools
import math
import os
import time
from collections import Counter
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field

from vrtm.bake import basis_maps, carry, layer_file, left_out, pool, read_back, report, sheet, staging
from vrtm.bake.console import Console
from vrtm.bake.failure import DEVICE, DONE, SIGNAL, Failure, describe
from vrtm.bake.frames import Frame
from vrtm.bake.left_out import LeftOut
from vrtm.bake.mesh_work import FrameResult
from vrtm.bake.pool import Jobs, Outcome
from vrtm.bake.remarks import Remarks, planned
from vrtm.bake.settings import Settings
from vrtm.bake.stopping import Stop
from vrtm.bake.words import counted
from vrtm.bake.work import Work

_LOOK = 0.1
"""Seconds between looks at whether a signal came."""
_START = 1.0
"""Seconds that Python and its modules take to start, before a further process opens the scene."""
_SAVED = 0.25
"""Expected gain in speed, against one process that uses all cores, for each doubling of the processes from two on. Two
on two cores were measured to save nothing."""

Task = tuple[str, Frame]
"""A mesh's name and a frame."""


def bake(settings: Settings, console: Console, stop: Stop) -> int:
    """Bakes, and returns the exit code. Errors are printed."""
    try:
        failure = _baked(settings, Remarks(console), stop)
    except Exception as error:
        failure = describe(error)
    console.close()
    if failure is not None:
        # A task of a farm may find nothing left to do.
        (console.error if failure.code else console.info)(failure.message)
        return failure.code
    return DONE


@dataclass
class _Made:
    """All that a bake has made so far."""

    results: list[FrameResult] = field(default_factory=list)
    basis: basis_maps.Made = field(default_factory=basis_maps.Made)
    carried: list[dict] = field(default_factory=list)
    """Rows of the report about geometry on the surface."""
    carried_files: Counter = field(default_factory=Counter)
    """The numbers of files with it that were `written` and `skipped`."""
    differences: list[read_back.Differences] = field(default_factory=list)
    """Readers of what was written."""
    failure: Failure | None = None
    """The first failure that ends a bake at once, or that its results are."""

    def count(self, state: str) -> int:
        """Files that were `written` or `skipped`."""
        of_frames = sum(result.count(state) for result in self.results)
        return of_frames + getattr(self.basis, state) + self.carried_files[state]


@dataclass
class _Bake:
    """A scene that is open and checked, to be baked."""

    work: Work
    carried: carry.Carry | None
    say: Remarks
    stop: Stop
    opening: float
    """Seconds that the scene took to open."""
    idle: Failure | None
    """The failure of a layer that would redirect nothing, if the bake is a dry run."""


def _baked(settings: Settings, say: Remarks, stop: Stop) -> Failure | None:
    """Opens the scene, bakes it and writes the report; returns the failure, if there is one. Raises Failure for a
    scene that cannot be baked."""
    start, console = time.perf_counter(), say.console
    with contextlib.ExitStack() as opened:
        with stop.at_once(console.error):
            baking = _opened(settings, say, stop, opened)
            work = baking.work
            if settings.dry_run:
                say.info(*planned(work), *left_out.listed(work.left_out))
                return report.strict(settings, work.left_out) or baking.idle
        made = _made(baking)
        missing = _missing(baking, made)
        made.failure = made.failure or report.strict(settings, missing)
        seconds = time.perf_counter() - start
        if settings.report is not None:
            content = report.document(work, made.results, seconds, made.failure, say.warnings, missing, made.carried)
            try:
                report.write(settings.report, content)
            except Failure as error:
                if made.failure is not None:
                    say.warn(error.message)
                made.failure = made.failure or error
    say.ended(work, made.results, missing)
    if made.results or made.failure is None:
        files = f"{counted(made.count('written'), 'file')} written, {made.count('skipped')} up to date"
        say.info(f"{files}, in {seconds:.1f} s: {settings.out}")
    console.status("done" if made.failure is None else made.failure.message.splitlines()[-1])
    return made.failure


def _opened(settings: Settings, say: Remarks, stop: Stop, opened: contextlib.ExitStack) -> _Bake:
    """The scene, open until the end of `opened`; all that can be known to be wrong before the first solve raises
    Failure."""
    start = time.perf_counter()
    say.console.status(f"opening {settings.scene}")
    # A library that reads it may crash: then the log names it.
    say.console.verbose(f"opening {settings.scene}")
    work = opened.enter_context(Work(settings, settings.threads))
    opening = time.perf_counter() - start
    work.look_for_gain(stop.check)
    if settings.layer:
        layer_file.check(work)
    if settings.basis:
        basis_maps.check(work)
    carried = carry.Carry(work) if settings.carry_prims else None
    if carried is not None:
        # What is carried needs no maps.
        work.left_out = [*(of for of in work.left_out if of.mesh not in carried.paths), *carried.left_out]
    of_layer = layer_file.names(settings)[1:] if "--layer" in settings.beside else ()
    work.check_files(of_layer, carried.files if carried else ())
    say.opened(work, carried)
    notes, idle = layer_file.foretell(work) if settings.layer else ((), None)
    say.warn(*notes)
    if idle is not None and not settings.dry_run:
        raise idle
    if not settings.only_layer:
        work.check_units()
    return _Bake(work, carried, say, stop, opening, idle)


def _made(baking: _Bake) -> _Made:
    """All files. A failure ends with what is there, for the report; if folders cannot be written to, Failure is
    raised."""
    settings, console = baking.work.settings, baking.say.console
    # Better known now than after hours.
    made = _Made(failure=report.strict(settings, baking.work.left_out))
    if made.failure is not None:
        return made
    baking.work.try_folders()
    try:
        _sweep(baking.work)
        if not settings.only_layer:
            baking.say.idle_files(baking.work.remove_idle())
            _add_frames(baking, made.results)
        if settings.sheet:
            _draw_sheets(baking, made.results)
        made.failure = report.nothing(made.results) or report.tolerance(baking.work, made.results)
        if settings.basis:
            console.status("fitting basis maps")
            made.basis = basis_maps.write(baking.work, made.results, baking.stop.check)
            baking.say.info(*made.basis.lines)
            made.failure = made.failure or made.basis.failure
        if baking.carried is not None:
            console.status("carrying what is on the skin")
            made.carried, made.carried_files = baking.carried.write(baking.stop.check, baking.say.warn)
            made.differences.append(baking.carried.differences)
            baking.say.info(*(f"{settings.carry_file}: {carry.line(row)}" for row in made.carried))
        if "--layer" in settings.beside:
            console.status(f"writing {settings.layer}")
            notes, lacking, differences = layer_file.write(baking.work)
            baking.say.warn(*notes)
            made.failure = made.failure or lacking
            made.differences.append(differences)
        if settings.check:
            made.failure = made.failure or _read_back(baking, made)
    except Exception as error:
        made.failure = describe(error)
    return made


def _read_back(baking: _Bake, made: _Made) -> Failure | None:
    """Opens the results as those do who take them, and returns the failure of one that is not as meant."""
    start, work = time.perf_counter(), baking.work
    baking.say.console.status("reading back what was written")
    maps = [] if work.settings.only_layer else [functools.partial(read_back.maps, work, made.results)]
    meshes = [functools.partial(read_back.morphed, work, *of) for of in made.basis.meshes]
    found = read_back.failure([*maps, *meshes, *made.differences])
    baking.say.console.verbose(f"read back in {time.perf_counter() - start:.2f} s")
    return found


def _sweep(work: Work) -> None:
    """Removes temporary files of programs that were killed."""
    beside = [os.path.dirname(path) or "." for path in work.settings.beside.values()]
    for folder in beside + ([] if work.settings.only_layer else work.folders()):
        staging.sweep(folder)


def _draw_sheets(baking: _Bake, results: list[FrameResult]) -> None:
    """Draws each mesh in its worst frame. Raises Failure."""
    work = baking.work
    for name, file in work.sheets().items():
        own = [result for result in results if result.mesh == name and result.tiles]
        own.sort(key=lambda result: result.frame)
        if own:
            worst = sheet.worst(own)
            positions = work.scene.positions(work.meshes[name].shape, worst.frame)
            drawn = sheet.write(work.meshes[name], worst.frame, positions, file, baking.stop.check)
            baking.say.info(f"{file}: frame {worst.frame}{'' if drawn else ', up to date'}")


def _missing(baking: _Bake, made: _Made) -> list[LeftOut]:
    """The list of parts that are not baked, with those that were met since the start."""
    late = [entry for result in made.results for entry in result.left_out]
    for entry in baking.work.scene.said():
        # Met by a frame that failed, or by the layer.
        if isinstance(entry, LeftOut):
            late.append(entry)
        baking.say.warn(entry.line() if isinstance(entry, LeftOut) else entry)
    return left_out.merged([*baking.work.left_out, *late])


def _add_frames(baking: _Bake, results: list[FrameResult]) -> None:
    """Bakes all frames. `results` grows as they are done. Raises Failure."""
    work, settings, say = baking.work, baking.work.settings, baking.say
    tasks = _tasks(work)
    say.console.start(len(tasks), f"baking {counted(len(tasks), 'frame')}")
    current = {}
    for task in tasks:
        baking.stop.check()
        current[task] = work.is_current(*task)
    stale = _stale(settings, tasks, current)
    for task in tasks:
        result = current[task]
        if task not in stale and result is not None:
            results.append(result)
            say.done(work, result)
    if not stale:
        return
    if settings.jobs or settings.warm:
        _solve(baking, stale, pool.split(settings, work, len(stale)), results)
        return
    # The cost of one frame tells whether further processes are worth their start.
    first, *others = stale
    start = time.perf_counter()
    _solve(baking, [first], (1, settings.threads), results)
    alone = (time.perf_counter() - start) * len(others)
    jobs, threads = pool.split(settings, work, len(others))
    if alone * (1 - 1 / (1 + _SAVED * math.log2(max(jobs, 2) / 2))) < _START + baking.opening:
        jobs, threads = 1, settings.threads
    if others:
        _solve(baking, others, (jobs, threads), results)


def _tasks(work: Work) -> list[Task]:
    meshes = [name for name, mesh in work.meshes.items() if mesh.gains]
    if work.settings.warm:
        return [(mesh, frame) for mesh in meshes for frame in work.frames]
    return [(mesh, frame) for frame in work.frames for mesh in meshes]


def _stale(settings: Settings, tasks: list[Task], current: dict[Task, FrameResult | None]) -> list[Task]:
    """The tasks with files that are not up to date, in their order."""
    stale = [task for task in tasks if current[task] is None]
    if not settings.warm:
        return stale
    # Each frame of a mesh starts from the one before it.
    last = {mesh: frame for mesh, frame in stale}
    return [(mesh, frame) for mesh, frame in tasks if mesh in last and frame <= last[mesh]]


def _solve(baking: _Bake, tasks: list[Task], split: tuple[int, int], results: list[FrameResult]) -> None:
    """Does tasks with so many jobs and threads. Raises Failure."""
    (jobs, threads), stop, work = split, baking.stop, baking.work
    baking.say.begun(len(tasks), jobs, threads)
    with Jobs(work.settings, work, jobs, threads, stop) as running:
        waiting = running.submit(tasks)
        failure: Failure | None = None
        pending = set(waiting)
        while pending:
            ready, pending = wait(pending, _LOOK, FIRST_COMPLETED)
            for future in ready:
                outcome = _outcome(future, waiting[future], stop)
                if isinstance(outcome, Failure):
                    failure = failure or outcome
                else:
                    results.append(outcome)
                    baking.say.done(work, outcome)
            if stop.event.is_set() or failure is not None:
                # The failure is told, not the end of the others that it leads to.
                asked = stop.signal != 0
                running.cancel()
                raise stop.failure() if asked else failure or stop.failure()


def _outcome(future: Future, task: Task, stop: Stop) -> Outcome:
    mesh, frame = task
    message = f"{mesh}, frame {frame}: a worker process was ended from outside; memory may be short: try fewer --jobs"
    ended = Failure(DEVICE, message)
    try:
        outcome = future.result()
        alone = isinstance(outcome, Failure) and outcome.code == SIGNAL and not stop.event.is_set()
        return ended if alone else outcome
    except BrokenProcessPool:
        return ended
    except Exception as error:
        return describe(error)
