"""Files that appear complete or not at all: each is written under a temporary name beside its own, brought to the disk,
and renamed.

Others may write to that folder, too, and put a link to another file in the place of the temporary one. So nothing is
opened by that name: what is written goes through the descriptor that the file was made with, and names are looked up in
the folder that was opened, whatever its path leads to by then.
"""

import contextlib
import errno
import os
import re
import secrets
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import BinaryIO

if os.name == "posix":
    import fcntl

_TEMPORARY = re.compile(r"\..+\.[0-9a-f]{16}\.part")
_STALE_SECONDS = 86400.0
"""Age at which a temporary file is nobody's any more, where locks cannot tell."""


def write(
    path: str, body: Callable[[str], None], ending: str = "", is_whole: Callable[[str], bool] | None = None
) -> None:
    """Calls `body` with a path to write to, and makes what it wrote the content of `path`, whose folder is made if need
    be. If it raises, nothing is left. `ending`: of the path that `body` gets, where that has to tell the format, or
    where `body` makes another file than the one that is there. `is_whole` looks at what was written, where `body`
    cannot be trusted to tell of a disk that is full. Raises OSError."""

    def fill(place: str) -> None:
        body(place)
        if is_whole is not None and not is_whole(place):
            raise OSError(errno.EIO, "it is damaged as soon as it is written: is the disk full?", path)

    with _made(path) as file:
        # Leads to the open file, where the system has such paths.
        direct = f"/proc/self/fd/{file.fileno()}"
        if not ending and os.path.exists(direct):
            fill(direct)
            return
        # Nobody else writes to this folder.
        with tempfile.TemporaryDirectory(prefix="vrtm-") as own:
            place = os.path.join(own, f"file{ending}")
            fill(place)
            with open(place, "rb") as source:
                shutil.copyfileobj(source, file, 1 << 20)


def write_bytes(path: str, content: bytes) -> None:
    """Writes a whole file in this way."""
    with _made(path) as file:
        file.write(content)


def try_folder(folder: str) -> None:
    """Raises OSError if no file can be written to a folder, which is made if need be."""
    with _folder(folder) as place, _reserved(place, "try") as (_, file):
        file.write(b"vrtm")
        file.flush()


@dataclass(frozen=True)
class _Place:
    """A folder, which stays the same one whatever becomes of its name."""

    path: str
    descriptor: int | None
    """None where the system has none of folders."""

    def at(self, name: str) -> str:
        """A name in it, as functions take it that are given the descriptor, too."""
        return os.path.join(self.path, name) if self.descriptor is None else name

    def has(self, name: str, file: BinaryIO) -> bool:
        """True if a name in it is that of an open file."""
        try:
            found = os.stat(self.at(name), dir_fd=self.descriptor, follow_symlinks=False)
        except OSError:
            return False
        return os.path.samestat(os.fstat(file.fileno()), found)


@contextlib.contextmanager
def _folder(folder: str) -> Iterator[_Place]:
    """Opens a folder, which is made if need be."""
    os.makedirs(folder or ".", exist_ok=True)
    # As the system finds it: `link/..` is not where it seems.
    folder = os.path.realpath(folder or ".")
    if os.name != "posix":
        yield _Place(folder, None)
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield _Place(folder, descriptor)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def _made(path: str) -> Iterator[BinaryIO]:
    """A new file, which gets the name of `path` at the end of the block."""
    folder, name = os.path.split(path)
    with _folder(folder) as place, _reserved(place, name) as (temporary, file):
        yield file
        file.flush()
        # Else a file system may notice only after the rename that there is no room, or that the power has failed.
        _bring_to_disk(file.fileno())
        if place.descriptor is None:
            # There an open file cannot be renamed.
            file.close()
        elif not place.has(temporary, file):
            raise OSError(errno.EEXIST, "another program put something else in its place while it was written", path)
        os.replace(place.at(temporary), place.at(name), src_dir_fd=place.descriptor, dst_dir_fd=place.descriptor)
        if place.descriptor is not None:
            _bring_to_disk(place.descriptor)


def _bring_to_disk(descriptor: int) -> None:
    """Waits until a file, or the names in a folder, are on the disk. Raises OSError if they cannot be."""
    try:
        os.fsync(descriptor)
    except OSError as error:
        # Some file systems cannot.
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS, errno.EBADF):
            raise


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
def _reserved(place: _Place, name: str) -> Iterator[tuple[str, BinaryIO]]:
    """A new, locked file, and its temporary name, which is gone afterwards if it was not renamed."""
    while True:
        temporary = f".{name}.{secrets.token_hex(8)}.part"
        flags = os.O_CREAT | os.O_EXCL | os.O_RDWR
        file = open(os.open(place.at(temporary), flags, 0o666, dir_fd=place.descriptor), "w+b")
        if place.descriptor is None or (_lock(file.fileno()) is not False and place.has(temporary, file)):
            break
        # Another program's sweep was quicker than the lock.
        file.close()
    try:
        yield temporary, file
    finally:
        if place.descriptor is None:
            # There an open file cannot be removed either.
            _close(file)
        with contextlib.suppress(OSError):
            os.remove(place.at(temporary), dir_fd=place.descriptor)
        _close(file)


def _close(file: BinaryIO) -> None:
    # An earlier failed write was reported.
    with contextlib.suppress(OSError):
        file.close()


def _lock(descriptor: int) -> bool | None:
    """True if the lock is ours, False if it is another's, None where the file system has no locks."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def _remove_abandoned(path: str) -> bool:
    """Removes a file if nobody holds its lock; tells whether it did."""
    descriptor = None
    try:
        old = time.time() - os.lstat(path).st_mtime > _STALE_SECONDS
        if os.name == "posix":
            # Neither a link nor a pipe, which nobody may ever read, is a file of vrtm's.
            descriptor = os.open(path, os.O_WRONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
            # Held until the file is gone: a writer that has just made it sees that, and makes another. Only age tells
            # where there are no locks.
            locked = _lock(descriptor)
            old = old if locked is None else locked
        if old:
            os.remove(path)
        return old
    except OSError:
        return False
    finally:
        if descriptor is not None:
            os.close(descriptor)
