"""Frames side by side: one job in a thread of this process, several in processes of their own.

Processes, since reading a pose and turning it into arrays holds Python's lock; and each has a device of its own. They
are spawned, not forked: a fork copies locks that other threads hold. They leave signals to the main process, which
tells them through a pipe to stop, and they end by themselves when it is gone.
"""

import contextlib
import math
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing.connection import Connection, wait

from vrtm.bake.failure import Failure, describe
from vrtm.bake.frames import Frame
from vrtm.bake.mesh_work import FrameResult
from vrtm.bake.settings import Settings
from vrtm.bake.stopping import ENDING, Stop
from vrtm.bake.work import Choices, Work

_BYTES_PER_TEXEL = 100
"""Of the images of a tile, while one is made."""
_BYTES_PER_JOB = 300 << 20
"""Python and its modules, and the scene."""


Outcome = FrameResult | Failure
"""The result of a job, or its failure."""


class Jobs(contextlib.AbstractContextManager):
    """Bakes frames. A context manager: at its end nothing runs any more."""

    def __init__(self, settings: Settings, work: Work, jobs: int, threads: int, stop: Stop) -> None:
        """A single job uses `work`. Of several jobs, each opens the scene itself and solves on `threads` threads."""
        self.stop = stop
        self._work = work
        self._sender: Connection | None = None
        self._executor: Executor
        self._begun: list[Future] = []
        if jobs == 1:
            self._executor = ThreadPoolExecutor(1, "bake")
        else:
            context = multiprocessing.get_context("spawn")
            receiver, self._sender = context.Pipe(duplex=False)
            # Python starts a process of its own with the first lock, which must outlive those that the signals end.
            with _blocked():
                self._executor = ProcessPoolExecutor(jobs, context, _begin, (settings, threads, receiver, work.choices))

    def submit(self, tasks: list[tuple[str, Frame]]) -> dict[Future, tuple[str, Frame]]:
        """Begins all tasks, each a mesh and a frame; a future each of an Outcome."""
        if self._sender is None:
            begun = {self._executor.submit(_outcome, self._work, *task, self.stop): task for task in tasks}
        else:
            with _blocked():
                begun = {self._executor.submit(_in_process, *task): task for task in tasks}
        self._begun += begun
        return begun

    def cancel(self) -> None:
        """Ends what is under way within milliseconds, and what has not begun at once."""
        self.stop.event.set()
        if self._sender is not None:
            self._sender.close()
        # Not by `shutdown(wait=False)`: then nothing would wait for the executor's own thread, which may close a pipe
        # just when Python writes to it at its end.
        for future in self._begun:
            future.cancel()

    def __exit__(self, *_: object) -> None:
        if self._sender is not None:
            self._sender.close()
        self._executor.shutdown(wait=True, cancel_futures=True)


@contextlib.contextmanager
def _blocked() -> Iterator[None]:
    """Processes that are started in the block never see the signals that ask to end; this one sees them after it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _outcome(work: Work, mesh: str, frame: Frame, stop: Stop) -> Outcome:
    try:
        stop.check()
        return work.bake(mesh, frame, stop.check)
    except Exception as error:
        return describe(error, f"{mesh}, frame {frame}")


class _Worker:
    """A worker process: its scene, once there is something to do, and whether it is to stop."""

    def __init__(self, settings: Settings, threads: int, receiver: Connection, choices: Choices) -> None:
        self.settings, self.threads, self.receiver, self.choices = settings, threads, receiver, choices
        self.stop = Stop()
        self.busy = threading.Lock()
        self.work: Work | None = None
        for watch in (self._watch_parent, self._watch_signals):
            threading.Thread(target=watch, name="watch", daemon=True).start()

    def _watch_parent(self) -> None:
        parent = multiprocessing.parent_process()
        assert parent is not None
        # The pipe ends when the parent closes its side, or is gone. To wait for the executor's queue to say so would
        # not do: another worker that was killed may hold the queue's lock for ever.
        wait([self.receiver, parent.sentinel])
        self._end()

    def _watch_signals(self) -> None:
        """SIGTERM is blocked, so that it does not interrupt anything: it comes here."""
        if hasattr(signal, "sigwait"):
            signal.sigwait({signal.SIGTERM})
            self._end()

    def _end(self) -> None:
        """Ends the process when the task, which is cancelled, has taken its temporary file away."""
        self.stop.event.set()
        with self.busy:
            os._exit(1)


_worker: _Worker | None = None


def _begin(settings: Settings, threads: int, receiver: Connection, choices: Choices) -> None:
    global _worker
    if not hasattr(signal, "pthread_sigmask"):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    _worker = _Worker(settings, threads, receiver, choices)


def _in_process(mesh: str, frame: Frame) -> Outcome:
    worker = _worker
    assert worker is not None
    if worker.work is None:
        try:
            # The process may end meanwhile.
            worker.work = Work(worker.settings, worker.threads, worker.choices)
            # The main process has said the same.
            worker.work.heard(), worker.work.told()
        except Exception as error:
            return describe(error)
    with worker.busy:
        return _outcome(worker.work, mesh, frame, worker.stop)


def available() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def split(settings: Settings, work: Work, tasks: int) -> tuple[int, int]:
    """(jobs, threads per job) for so many tasks. A GPU gets one job: frames would wait for one another there."""
    cores = available()
    # Frames that start from one another are baked one after the other.
    jobs = 1 if settings.warm else settings.jobs
    if jobs == 0:
        jobs = 1 if work.device.info.backend == "gpu" else min(cores, _fitting(work))
    jobs = max(1, min(jobs, tasks))
    threads = settings.threads or max(1, cores // jobs)
    return jobs, threads


def _fitting(work: Work) -> int:
    """Number of jobs that the free memory has room for."""
    tiles = [tile for mesh in work.meshes.values() for tile in mesh.tiles]
    # A size that follows from what the map holds is at most twice the grid's.
    images = max((math.prod(tile.size) or 4 * math.prod(tile.cells) for tile in tiles), default=0)
    free = _free()
    return max(1, free // (work.bytes + images * _BYTES_PER_TEXEL + _BYTES_PER_JOB)) if free else 1 << 16


def _free() -> int:
    """Bytes of memory that are free; 0 if the system does not tell."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            lines = dict(line.split(":", 1) for line in file)
        return int(lines["MemAvailable"].split()[0]) << 10
    except (OSError, KeyError, ValueError):
        return 0
