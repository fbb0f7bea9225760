"""Long calls, which Ctrl-C is to end."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")

# How often the main thread looks whether Ctrl-C was pressed, in seconds; the end of a call wakes it at once.
_LOOK = 0.1


def interruptible(call: Callable[[], Result], cancel: Callable[[], object]) -> Result:
    """Runs a call that can be cancelled. Python handles signals on its main thread alone, and not while that is inside
    the library: so there the call runs on a thread of its own, and KeyboardInterrupt cancels it."""
    if threading.current_thread() is not threading.main_thread():
        return call()
    results: list[Result] = []
    errors: list[BaseException] = []
    ended = threading.Event()

    def run() -> None:
        try:
            results.append(call())
        except BaseException as error:
            errors.append(error)
        finally:
            ended.set()

    thread = threading.Thread(target=run, name="vrtm")
    thread.start()
    try:
        while not ended.wait(_LOOK):
            pass
    except BaseException:
        # It may have been cancelled before it began to solve: then once more.
        while not ended.is_set():
            cancel()
            ended.wait(0.005)
        raise
    finally:
        thread.join()
    if errors:
        raise errors[0]
    return results[0]
