"""The course of a bake."""

from __future__ import annotations

import os
import re
import time
from concurrent.futures import FIRST_COMPLETED, wait
from concurrent.futures.process import BrokenProcessPool

from vrtm.bake import cores, layer_file, report, staging
from vrtm.bake.console import Console
from vrtm.bake.failure import DEVICE, DONE, SIGNAL, Failure, describe
from vrtm.bake.mesh_work import FrameResult
from vrtm.bake.pool import Jobs, Outcome
from vrtm.bake.settings import Settings
from vrtm.bake.stopping import Stop, signals
from vrtm.bake.work import Work

# A number in a warning, but for a tile's and for digits within a name.
_NUMBER = re.compile(r"(?<!tile )\b\d[\d.]*")
_LOOK = 0.1
"""Seconds between looks at whether a signal came."""


def bake(settings: Settings, console: Console) -> int:
    """Bakes, and returns the exit code. Errors are printed."""
    with signals() as stop:
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
    warnings: list[str] = []

    def warn(message: str) -> None:
        # Each worker process opens the scene, and its library warns again.
        if message not in warnings:
            warnings.append(message)
            console.warning(message)

    with Work(settings, settings.threads) as work:
        stop.check()
        if settings.layer:
            layer_file.check(work)
        work.check_files()
        for note in work.notes():
            warn(note)
        results: list[FrameResult] = []
        failure: Failure | None = None
        try:
            beside = [os.path.dirname(settings.layer) or "."] if settings.layer else []
            for folder in beside + ([] if settings.only_layer else work.folders()):
                staging.sweep(folder)
            if not settings.only_layer:
                _frames(settings, work, console, stop, results, warn)
            failure = report.tolerance(settings, results)
            if settings.layer:
                console.status(f"writing {settings.layer}")
                notes, idle = layer_file.write(work)
                for note in notes:
                    warn(note)
                failure = failure or idle
        except Exception as error:
            failure = describe(error)
        seconds = time.perf_counter() - start
        if settings.report is not None:
            try:
                report.write(settings.report, report.document(work, results, seconds, failure, warnings))
            except Failure as error:
                if failure is not None:
                    warn(error.message)
                failure = failure or error
    written = sum(result.count("written") for result in results)
    skipped = sum(result.count("skipped") for result in results)
    console.close()
    console.info(f"{written} files written, {skipped} up to date, in {seconds:.1f} s: {settings.out}")
    console.status("done" if failure is None else failure.message.splitlines()[-1])
    return failure


def _frames(settings: Settings, work: Work, console: Console, stop: Stop, results: list[FrameResult], warn) -> None:
    """Bakes all frames. `results` grows as they are done. Raises Failure."""
    tasks = [(mesh, frame) for frame in work.frames for mesh in work.meshes]
    console.start(len(tasks), f"baking {len(tasks)} frames")

    seen: set[tuple[str, int]] = set()
    kinds: set[str] = set()

    def done(result: FrameResult) -> None:
        results.append(result)
        for note in result.warnings:
            # Tears and folds differ from frame to frame in their numbers alone: the first of them are told. A warning
            # of a pose names its frame, and is told for each.
            kind = note if ", frame " in note else _NUMBER.sub("#", note)
            if kind not in kinds:
                kinds.add(kind)
                warn(note)
        for tile in result.tiles:
            if (result.mesh, tile["udim"]) not in seen:
                seen.add((result.mesh, tile["udim"]))
                path = work.meshes[result.mesh].shape.path
                console.detail(f"{path} tile {tile['udim']}: {report.shares(tile)}")
                if tile["frozen"] > report.MOSTLY:
                    warn(
                        f"{path} tile {tile['udim']}: {tile['frozen']:.0%} of its rigid texels are frozen, by chart "
                        "borders, UVs that overlap, or the mask: they stay as they are"
                    )
        written, skipped = result.count("written"), result.count("skipped")
        what = f"{written} files in {result.milliseconds:.0f} ms" if written else f"{skipped} files up to date"
        console.done(f"{result.mesh}, frame {result.frame}: {what}")

    left = []
    for task in tasks:
        stop.check()
        current = work.is_current(*task)
        if current is None:
            left.append(task)
        else:
            done(current)
    if not left:
        return
    jobs, threads = cores.split(settings, work, len(left))
    with Jobs(settings, work, jobs, threads, stop) as running:
        waiting = running.submit(left)
        failure: Failure | None = None
        pending = set(waiting)
        while pending:
            ready, pending = wait(pending, _LOOK, FIRST_COMPLETED)
            for future in ready:
                outcome = _result(future, waiting[future], stop)
                if outcome.result is not None:
                    done(outcome.result)
                elif outcome.failure is not None:
                    failure = failure or outcome.failure
            if stop.event.is_set() or failure is not None:
                # What fails is told, not the end of the others that it leads to.
                asked = stop.signal != 0
                running.cancel()
                raise stop.failure() if asked else failure or stop.failure()


def _result(future, task: tuple[str, int], stop: Stop) -> Outcome:
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
