"""Being asked to end: signals in the main process, and the flag that all work looks at."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

from vrtm.bake.failure import SIGNAL, Failure

ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))
"""Signals that ask a program to end; the last is Windows' Ctrl-Break."""


class Stop:
    """A flag that work looks at again and again, and the signal that set it."""

    def __init__(self) -> None:
        self.event = threading.Event()
        self.signal = 0

    def check(self) -> None:
        """Raises Failure once the flag is set."""
        if self.event.is_set():
            raise self.failure()

    def failure(self) -> Failure:
        """Why the program ends, with the exit code that shells give."""
        name = signal.Signals(self.signal).name if self.signal else "cancelled"
        return Failure(SIGNAL + self.signal, f"ended by {name}" if self.signal else name)


@contextlib.contextmanager
def signals() -> Iterator[Stop]:
    """Until the end of the block, signals set a flag instead of ending the process in the middle of a file."""
    stop = Stop()

    def handle(number: int, _frame: FrameType | None) -> None:
        stop.signal = stop.signal or number
        stop.event.set()

    before = {}
    if threading.current_thread() is threading.main_thread():
        for number in ENDING:
            # One that is ignored from the start, as nohup does, stays ignored.
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, handle)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
