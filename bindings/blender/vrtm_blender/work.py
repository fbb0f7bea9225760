"""A job: preparing an asset, solving and fetching the result, on a thread of its own, which touches none of Blender's
data."""

from __future__ import annotations

import concurrent.futures
import threading
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
        # True if the inputs are in the asset.
        self.applied = False
        self._prepared = prepared
        self._fraction: float | None = None
        # Its duration, once it is over.
        self.seconds = 0.0
        self._over, self._given_up = threading.Event(), threading.Event()
        self._outcome: Outcome | None = None
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="vrtm job")
        self._thread.start()

    def _run(self) -> None:
        begun = session.now()
        try:
            with session.listening() as notes:
                self._outcome = self._work(notes)
        except BaseException as error:  # told where the result is asked for.
            self._error = error
        finally:
            self.seconds = session.now() - begun
            self._over.set()

    def _work(self, notes: list[vrtm.LogEntry]) -> Outcome:
        prepared, request = self._prepared, self.request
        prepared.apply(self.inputs)
        self.applied = True
        if self._tell(0.0):
            raise concurrent.futures.CancelledError
        prepared.asset.solve(request.positions, progress=self._tell, **request.options)
        return outcome.fetch(prepared, request, prepared.notes(notes))

    def _tell(self, fraction: float) -> bool:
        """Takes the share of the solve that is done; True ends it."""
        self._fraction = fraction
        return self._given_up.is_set()

    @property
    def progress(self) -> float | None:
        """The fraction (0..1) of the solve that is done; None while the mesh is being prepared."""
        return self._fraction

    def done(self) -> bool:
        return self._over.is_set()

    def cancelled(self) -> bool:
        """True if it is over, and has no result because it was cancelled."""
        return self.done() and isinstance(self._error, concurrent.futures.CancelledError)

    def cancel(self) -> None:
        """Ends it soon. Preparing a mesh goes on to its end, and a result that is being fetched still counts."""
        self._given_up.set()

    def result(self) -> Outcome:
        """The outcome, once it is there; raises the job's error, and CancelledError after a cancel."""
        try:
            # Short waits, so that Ctrl-C is heard.
            while not self._over.wait(0.1):
                pass
        except BaseException:
            self.close()
            raise
        if self._error is not None:
            raise self._error
        return self._outcome

    def close(self) -> None:
        """Cancels it and waits for its end: nothing of it is left."""
        self.cancel()
        self._thread.join()
