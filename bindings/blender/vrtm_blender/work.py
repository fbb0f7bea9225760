"""A job: preparing an asset, solving and fetching the result, on a thread of its own, which touches none of Blender's
data."""

from __future__ import annotations

import concurrent.futures
import threading
import time
from typing import TYPE_CHECKING

from . import outcome, session
from .outcome import Outcome, Request
from .prepared import Inputs, Prepared

if TYPE_CHECKING:
    import vrtm


class Work:
    """A job whose result is an Outcome. Preparing and fetching take time, too: on a large mesh as much as solving."""

    def __init__(self, prepared: Prepared, inputs: Inputs, request: Request) -> None:
        self.request, self.inputs = request, inputs
        self._prepared = prepared
        # True if the inputs are in the asset.
        self.applied = False
        # The share (0..1) of the solve that is done; None while the mesh is being prepared.
        self.progress: float | None = None
        # Its duration, once it is over.
        self.seconds = 0.0
        self._given_up = threading.Event()
        self._future: concurrent.futures.Future[Outcome] = concurrent.futures.Future()
        self._thread = threading.Thread(target=self._run, name="vrtm job")
        self._thread.start()

    def _run(self) -> None:
        begun = time.monotonic()
        try:
            with session.listening() as notes:
                found = self._work(notes)
        except BaseException as error:  # told where the result is asked for.
            self._future.set_exception(error)
        else:
            self.seconds = time.monotonic() - begun
            self._future.set_result(found)

    def _work(self, notes: list[vrtm.LogEntry]) -> Outcome:
        prepared, request = self._prepared, self.request
        prepared.apply(self.inputs)
        self.applied = True
        if self._tell(0.0):
            raise concurrent.futures.CancelledError

        def solve() -> None:
            prepared.asset.solve(request.positions, progress=self._tell, **request.options)

        solve()
        if not request.is_draft:
            prepared.carriers.settle(request.positions, solve)
        return outcome.fetch(prepared, request, prepared.notes(notes))

    def _tell(self, fraction: float) -> bool:
        """Takes the share of the solve that is done; True ends it."""
        self.progress = fraction
        return self._given_up.is_set()

    def done(self) -> bool:
        return self._future.done()

    def cancelled(self) -> bool:
        """True if it is over, and has no result because it was cancelled."""
        return self.done() and isinstance(self._future.exception(), concurrent.futures.CancelledError)

    def cancel(self) -> None:
        """Ends it soon. Preparing a mesh goes on to its end, and a result that is being fetched still counts."""
        self._given_up.set()

    def result(self) -> Outcome:
        """The outcome, once it is there; raises the job's error, and CancelledError after a cancel."""
        try:
            # Short waits, so that Ctrl-C is heard.
            while not self.done():
                concurrent.futures.wait([self._future], 0.1)
        except BaseException:
            self.close()
            raise
        return self._future.result()

    def close(self) -> None:
        """Cancels it and waits for its end: nothing of it is left."""
        self.cancel()
        self._thread.join()
