"""Files that appear complete or not at all: each is written under a temporary name beside its own, and renamed."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import time
from collections.abc import Callable, Iterator

if os.name == "posix":
    import fcntl

_TEMPORARY = re.compile(r"\..+\.[0-9a-f]{16}\.part(\.usd[ac])?")
_STALE_SECONDS = 86400.0
"""Age at which a temporary file is nobody's any more, where locks cannot tell."""


def write(path: str, body: Callable[[str], None], ending: str = "") -> None:
    """Calls `body` with a temporary path in the folder of `path`, which is made if need be, and renames what it wrote.
    If it raises, the temporary file is removed. `ending`: of the temporary name, where that has to tell the format.
    Raises OSError."""
    folder, name = os.path.split(os.path.abspath(path))
    os.makedirs(folder, exist_ok=True)
    with _reserved(folder, name, ending) as temporary:
        body(temporary)
        os.replace(temporary, path)


def write_bytes(path: str, content: bytes) -> None:
    """Writes a whole file in this way."""

    def body(temporary: str) -> None:
        with open(temporary, "wb") as file:
            file.write(content)

    write(path, body)


def sweep(folder: str) -> list[str]:
    """Removes temporary files whose writers were killed, and returns their paths. Those of programs that still run are
    left alone: a writer holds a lock, which the system releases when the writer is gone."""
    removed = []
    with contextlib.suppress(OSError):
        for entry in os.scandir(folder):
            if _TEMPORARY.fullmatch(entry.name) and _remove_abandoned(entry.path):
                removed.append(entry.path)
    return removed


@contextlib.contextmanager
def _reserved(folder: str, name: str, ending: str) -> Iterator[str]:
    """A new, locked file of a temporary name, which is gone afterwards if it was not renamed."""
    while True:
        temporary = os.path.join(folder, f".{name}.{secrets.token_hex(8)}.part{ending}")
        descriptor = os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
        if os.name != "posix":
            # There an open file cannot be renamed.
            os.close(descriptor)
            break
        if _lock(descriptor) and _is(descriptor, temporary):
            break
        # Another program's sweep was quicker than the lock.
        os.close(descriptor)
    try:
        yield temporary
    finally:
        with contextlib.suppress(FileNotFoundError):
            os.remove(temporary)
        if os.name == "posix":
            os.close(descriptor)


def _lock(descriptor: int) -> bool:
    """Whether the lock is ours. Where the file system has no locks, it is: only age tells there."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


def _is(descriptor: int, path: str) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    except FileNotFoundError:
        return False


def _remove_abandoned(path: str) -> bool:
    """Removes a file if nobody holds its lock; tells whether it did."""
    descriptor = None
    try:
        old = time.time() - os.stat(path).st_mtime > _STALE_SECONDS
        if os.name == "posix":
            descriptor = os.open(path, os.O_WRONLY)
            try:
                # Held until the file is gone: a writer that has just made it sees that, and makes another.
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                old = True
            except BlockingIOError:
                return False
            except OSError:
                # Only age tells where there are no locks.
                pass
        if old:
            os.remove(path)
        return old
    except OSError:
        return False
    finally:
        if descriptor is not None:
            os.close(descriptor)
