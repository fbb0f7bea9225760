"""A solve and the fetching of what it came to, both on the job's own thread, which touches none of Blender's data."""

from __future__ import annotations

import concurrent.futures
import threading
from typing import TYPE_CHECKING

from . import results
from .session import Request

if TYPE_CHECKING:
    import vrtm


class Work:
    """A job whose result is the arrays to be written. Fetching them takes time, too: on a large mesh as much as
    solving."""

    def __init__(self, asset: vrtm.Asset, request: Request) -> None:
        self.request = request
        self._asset = asset
        self._over, self._given_up = threading.Event(), False
        self._outputs: results.Outputs | None = None
        self._error: BaseException | None = None
        self._job = asset.submit(request.positions, **request.options)
        # Called on the job's thread, which close() waits for; at once, and here, if the job is over already.
        self._job.add_done_callback(self._fetch)

    def _fetch(self, job: vrtm.Job) -> None:
        try:
            job.result(0)
            if not self._given_up:
                self._outputs = results.fetch(self._asset, self.request)
        except BaseException as error:  # told where the result is asked for.
            self._error = error
        finally:
            self._over.set()

    def done(self) -> bool:
        return self._over.is_set()

    def cancelled(self) -> bool:
        """Whether it is over and has nothing to be written because it was cancelled."""
        ended = isinstance(self._error, concurrent.futures.CancelledError)
        return self.done() and (ended or (self._outputs is None and self._error is None))

    def cancel(self) -> None:
        """Ends it soon. What is being fetched is fetched to its end, and still counts."""
        self._given_up = True
        self._job.cancel()

    def result(self) -> results.Outputs:
        """The arrays, once it is done; raises what went wrong, and CancelledError after a cancel."""
        if self._error is not None:
            raise self._error
        if self._outputs is None:
            raise concurrent.futures.CancelledError
        return self._outputs

    def close(self) -> None:
        """Cancels it and waits for its end: nothing of it is left."""
        self.cancel()
        self._job.close()
