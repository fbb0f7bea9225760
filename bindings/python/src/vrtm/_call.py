"""Long calls that Ctrl-C can cancel."""

import threading
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")

# Seconds between the main thread's checks for Ctrl-C; the end of a call wakes it at once.
_LOOK = 0.1


def interruptible(call: Callable[[], Result], cancel: Callable[[], object]) -> Result:
    """Runs a call that can be cancelled. Python handles signals only on its main thread, and not while that thread is
    inside the library. So there the call runs on a separate thread, and KeyboardInterrupt cancels it."""
    if threading.current_thread() is not threading.main_thread():
        return call()
    results: list[Result] = []
    errors: list[BaseException] = []
    begun, ended = threading.Lock(), threading.Event()

    def run() -> None:
        if not begun.acquire(blocking=False):
            return
        try:
            results.append(call())
        except BaseException as error:
            errors.append(error)
        finally:
            ended.set()

    thread = threading.Thread(target=run, name="vrtm")
    try:
        # It may be interrupted, too, before or after the thread has begun.
        thread.start()
        while not ended.wait(_LOOK):
            pass
    except BaseException:
        # A thread that has not begun by now never calls. The first cancel has no effect before the solve begins, so
        # cancel again.
        while not ended.is_set() and not begun.acquire(blocking=False):
            cancel()
            ended.wait(0.005)
        raise
    thread.join()
    if errors:
        raise errors[0]
    return results[0]
