"""Files that appear complete or not at all: each is written under a temporary name beside its own, brought to the disk,
and renamed."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import time
from collections.abc import Callable, Iterator

if os.name == "posix":
    import fcntl

_TEMPORARY = re.compile(r"\..+\.[0-9a-f]{16}\.part(\.usd[ac]?)?", re.IGNORECASE)
_STALE_SECONDS = 86400.0
"""Age at which a temporary file is nobody's any more, where locks cannot tell."""


def write(
    path: str, body: Callable[[str], None], ending: str = "", is_whole: Callable[[str], bool] | None = None
) -> None:
    """Calls `body` with a temporary path in the folder of `path`, which is made if need be, and renames what it wrote.
    If it raises, the temporary file is removed. `ending`: of the temporary name, where that has to tell the format.
    `is_whole` looks at what was written, where `body` cannot be trusted to tell of a disk that is full. Raises
    OSError."""
    folder, name = os.path.split(path)
    os.makedirs(folder or ".", exist_ok=True)
    # As the system finds it: `link/..` is not where it seems.
    folder = os.path.realpath(folder or ".")
    with _reserved(folder, name, ending) as temporary:
        body(temporary)
        # Else a file system may notice only after the rename that there is no room, or that the power has failed.
        _bring_to_disk(temporary)
        if is_whole is not None and not is_whole(temporary):
            raise OSError(errno.EIO, "it is damaged as soon as it is written: is the disk full?", path)
        os.replace(temporary, os.path.join(folder, name))
    if os.name == "posix":
        _bring_to_disk(folder)


def write_bytes(path: str, content: bytes) -> None:
    """Writes a whole file in this way."""

    def body(temporary: str) -> None:
        with open(temporary, "wb") as file:
            file.write(content)

    write(path, body)


def try_folder(folder: str) -> None:
    """Raises OSError if no file can be written to a folder, which is made if need be."""
    os.makedirs(folder or ".", exist_ok=True)
    with _reserved(os.path.realpath(folder or "."), "try", "") as temporary, open(temporary, "wb") as file:
        file.write(b"vrtm")


def _bring_to_disk(path: str) -> None:
    """Waits until a file, or the names in a folder, are on the disk. Raises OSError if they cannot be."""
    # Windows brings only what may be written to the disk, and has no such thing for folders.
    descriptor = os.open(path, os.O_RDONLY if os.name == "posix" else os.O_RDWR)
    try:
        os.fsync(descriptor)
    except OSError as error:
        # Some file systems cannot.
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS, errno.EBADF):
            raise
    finally:
        os.close(descriptor)


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
