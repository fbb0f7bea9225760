"""Jobs: solves that run beside the caller's own work."""

import asyncio
import atexit
import concurrent.futures
import contextlib
import ctypes
import threading
import weakref
from collections.abc import Callable, Generator, Iterator
from typing import Any

from numpy.typing import ArrayLike

from . import _abi
from ._arrays import Pinned
from ._errors import CancelledError, TimeoutError
from ._library import Owned, check, library, new
from ._options import SolveOptions, build
from ._records import AssetReport


class Job(Owned, concurrent.futures.Future[AssetReport]):
    """A solve under way, made by Asset.submit: a future whose result is the asset's report. It can also be awaited.

    result() and exception() wait with the GIL released, and take a timeout in seconds. cancel() returns at once, and
    the solve ends within milliseconds; result() and `await` then raise CancelledError. close(), or the end of a `with`
    block, cancels it and waits for its end, as does a task that is cancelled while it awaits the job: the asset is free
    then. Callbacks run on a thread of the job. The progress function cannot wait for its own job: BusyError.
    """

    def __init__(
        self, asset: _abi.vrtm_asset, report: Callable[[], AssetReport], positions: ArrayLike, options: SolveOptions
    ) -> None:
        super().__init__()
        pinned = Pinned()
        points = pinned.vectors("positions", positions, 3, more=1)
        struct, self._progress = build(pinned, options)
        handle = _abi.vrtm_job()
        check(library.vrtm_asset_submit(asset, ctypes.byref(points), ctypes.byref(struct), ctypes.byref(handle)))
        # A method of the asset, which it keeps alive.
        self._report = report
        self._own(handle, library.vrtm_job_destroy)
        _running.add(self)
        # The thread keeps the job, and so the asset and the progress function, alive until the end.
        self._thread = threading.Thread(target=self._wait, name="vrtm job", daemon=True)
        self._thread.start()

    def _wait(self) -> None:
        try:
            error: BaseException | None = None
            report = None
            try:
                check(library.vrtm_job_wait(self._handle, _abi.VRTM_FOREVER))
                report = self._report()
            except Exception as raised:
                error = raised
        finally:
            _running.discard(self)
        if self._progress is not None and self._progress.error is not None:
            error = self._progress.error
        if isinstance(error, CancelledError):
            super().cancel()
        if not self.set_running_or_notify_cancel():
            return
        if error is None and report is not None:
            self.set_result(report)
        else:
            self.set_exception(error)

    @property
    def progress(self) -> float:
        """Predicted fraction (0..1) of the work that is done; it never decreases."""
        struct = new(_abi.vrtm_job_progress)
        check(library.vrtm_job_get_progress(self._handle, ctypes.byref(struct)))
        return float(struct.progress)

    def cancel(self) -> bool:
        """Cancels the solve; returns at once, False if it was done already. A solve that already has its result ends
        normally."""
        if self.done():
            return self.cancelled()
        library.vrtm_job_cancel(self._handle)
        return True

    def running(self) -> bool:
        """True until the job is done."""
        return not self.done()

    def result(self, timeout: float | None = None) -> AssetReport:
        """Waits for the end, for at most `timeout` seconds; returns the asset's report or raises the job's error."""
        with self._waiting():
            return super().result(timeout)

    def exception(self, timeout: float | None = None) -> BaseException | None:
        """Waits for the end; returns the job's exception, or None."""
        with self._waiting():
            return super().exception(timeout)

    def close(self) -> None:
        """Cancels the job and waits for its end."""
        self.cancel()
        with self._waiting():
            if threading.current_thread() is not self._thread:
                self._thread.join()
        super().close()

    def __await__(self) -> Generator[Any, None, AssetReport]:
        return self._awaited().__await__()

    async def _awaited(self) -> AssetReport:
        future = asyncio.wrap_future(self)
        # asyncio tells of exceptions that nobody has asked for; this one is raised below.
        future.add_done_callback(lambda ended: ended.cancelled() or ended.exception())
        try:
            await asyncio.wait([future])
        except asyncio.CancelledError:
            # It is the task that was cancelled, by a timeout or by hand: its next solve must not find the asset busy.
            self.cancel()
            await asyncio.wait([future])
            raise
        return self.result()

    @contextlib.contextmanager
    def _waiting(self) -> Iterator[None]:
        """Raises BusyError on a thread that does the job's work, which would wait for itself; and turns the exceptions
        of futures into those of this package, which are their subclasses."""
        if library.vrtm_job_wait(self._handle, 0) == _abi.VRTM_ERROR_BUSY:
            check(_abi.VRTM_ERROR_BUSY)
        try:
            yield
        except concurrent.futures.CancelledError:
            raise CancelledError(_abi.VRTM_ERROR_CANCELLED, "VRTM_ERROR_CANCELLED", "the job was cancelled") from None
        except concurrent.futures.TimeoutError as error:
            if type(error) is not concurrent.futures.TimeoutError:
                raise
            raise TimeoutError(_abi.VRTM_ERROR_TIMEOUT, "VRTM_ERROR_TIMEOUT", "the job is not done yet") from None


# Jobs that run: at the end of the process they are cancelled and waited for, since they may call Python functions.
_running: weakref.WeakSet[Job] = weakref.WeakSet()


@atexit.register
def _end_all() -> None:
    for job in list(_running):
        job.close()
