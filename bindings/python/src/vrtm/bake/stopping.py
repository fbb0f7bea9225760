"""Being asked to end: signals in the main process, and the flag that all work looks at."""

import contextlib
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from types import FrameType

from vrtm.bake.failure import SIGNAL, Failure

ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))
"""Signals that ask a program to end; the last is Windows' Ctrl-Break."""


class Stop:
    """A flag that work looks at again and again, and the signal that set it."""

    def __init__(self) -> None:
        self.event = threading.Event()
        self.signal = 0
        self._tell: Callable[[str], None] | None = None
        self._lock = threading.Lock()

    @contextlib.contextmanager
    def at_once(self, tell: Callable[[str], None]) -> Iterator[None]:
        """In the block a signal ends the process wherever it is, once `tell` was given the reason: for what takes long,
        looks at no flag, and writes nothing. Raises Failure if there was one before."""
        self.check()
        self._tell = tell
        try:
            yield
        finally:
            with self._lock:
                self._tell = None

    def hear(self, number: int) -> None:
        """A signal came. Not in its handler, which Python calls only between two of its own instructions."""
        with self._lock:
            self.signal = self.signal or number
            self.event.set()
            if self._tell is not None:
                failure = self.failure()
                self._tell(failure.message)
                os._exit(failure.code)

    def check(self) -> None:
        """Raises Failure once the flag is set."""
        if self.event.is_set():
            raise self.failure()

    def failure(self) -> Failure:
        """The failure of an ended program, with the exit code that shells give."""
        name = signal.Signals(self.signal).name if self.signal else "cancelled"
        return Failure(SIGNAL + self.signal, f"ended by {name}" if self.signal else name)


@contextlib.contextmanager
def signals() -> Iterator[Stop]:
    """Until the end of the block, signals set a flag instead of ending the process in the middle of a file."""
    stop = Stop()

    def handle(number: int, _frame: FrameType | None) -> None:
        stop.signal = stop.signal or number
        stop.event.set()

    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    # Python writes the numbers of signals to it at once, whatever the main thread is in.
    reader, writer = socket.socketpair()
    writer.setblocking(False)

    def listen() -> None:
        while heard := reader.recv(1):
            if heard[0] in before:
                stop.hear(heard[0])

    # One that is ignored from the start, as nohup does, stays ignored.
    heeded = [number for number in ENDING if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, handle) for number in heeded}
    told = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    listener = threading.Thread(target=listen, name="signals", daemon=True)
    listener.start()
    try:
        yield stop
    finally:
        signal.set_wakeup_fd(told)
        for number, handler in before.items():
            signal.signal(number, handler)
        writer.close()
        listener.join()
        reader.close()
