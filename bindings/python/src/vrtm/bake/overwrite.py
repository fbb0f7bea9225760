"""The files that a program of vrtm may replace: never one that it reads, and none that vrtm has not written."""

import contextlib
import mmap
import os
import re
import stat
from collections.abc import Callable, Iterable

_EXR, _PNG, _TIFF = b"\x76\x2f\x31\x01", b"\x89PNG", (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_CRATE, _LAYER, _ARCHIVE = b"PXR-USDC", b"#usda ", b"Ogawa\xff"
# The name of an attribute in EXR and PNG, the key of a JSON text in TIFF.
_IN_IMAGE = re.compile(rb"vrtm:(inputs|kind)[\0\"]")
_IN_ARCHIVE = b"_ai_Application=vrtm;"
"""The program that wrote an Alembic archive."""
# The beginning of a report, less its white space.
_REPORT = b'{"program":{"name":"vrtmbake"'
_GLTF = b'{"asset":{"generator":"vrtm'
"""After 20 bytes of a binary glTF's headers."""
_BEGINNING = 1 << 16
"""Bytes at a file's beginning that mostly include an image's mark."""
_LEAST_EXR = 256
"""Bytes of the shortest EXR, with the attributes that it must have."""


_LONGEST = 255 - len("..0123456789abcdef.part")
"""Bytes of a name that has a temporary name beside it, too."""


class Conflict(ValueError):
    """A file cannot be written without a loss. The message is a sentence that names it."""

    def __init__(self, message: str, replaceable: bool = False) -> None:
        super().__init__(message)
        self.replaceable = replaceable
        """True if `overwrite` would allow it."""


def check(outputs: Iterable[tuple[str, str]], inputs: Iterable[tuple[str, str]], overwrite: bool = False) -> None:
    """Raises Conflict if one of the outputs is one of the inputs or another output, or if there is a file in its place
    that is not vrtm's; with `overwrite` such a file may be replaced, but an input never.

    Each file is a path and what it is to the user, such as an option. Files are the same if their paths, less links,
    differ at most in the case of letters, since a folder may be shared with a system that does not tell that apart; or
    if they are one file under two names.
    """
    folders: dict[str, str] = {}
    known: dict[object, tuple[str, str]] = {}
    for path, what in inputs:
        for key in _keys(path, folders):
            known.setdefault(key, (path, what))
    taken: dict[object, tuple[str, str]] = {}
    for path, what in outputs:
        folder, name = os.path.split(path)
        if not name:
            raise Conflict(f"{what}: '{path}' names no file")
        if len(os.fsencode(name)) > _LONGEST:
            raise Conflict(f"{what}: {path}: its name has {len(os.fsencode(name))} bytes, more than {_LONGEST}")
        while folder and not os.path.lexists(folder):
            folder = os.path.dirname(folder)
        if folder and not os.path.isdir(folder):
            raise Conflict(f"{what}: {path}: {folder} is no folder")
        keys = _keys(path, folders)
        for key in keys:
            if key in known:
                other, of = known[key]
                named = of if other == path else f"{of} ({other})"
                raise Conflict(f"{what}: {path} would replace {named}, which is read")
            if key in taken:
                raise Conflict(f"{what}: {path} is also the file of {taken[key][1]}")
        taken.update((key, (path, what)) for key in keys)
        if not os.path.lexists(path):
            continue
        if os.path.exists(path) and not os.path.isfile(path):
            raise Conflict(f"{what}: {path} is there, and is no file")
        if not overwrite and not is_ours(path):
            raise Conflict(f"{what}: {path} is there, and is no file that vrtm has written", replaceable=True)


def is_ours(path: str) -> bool:
    """True if a file carries vrtm's mark, or holds nothing that could be lost."""
    try:
        found = os.stat(path)
        if not stat.S_ISREG(found.st_mode):
            # A pipe would be waited for.
            return False
        size = found.st_size
        with open(path, "rb") as file:
            text = file.read(_BEGINNING)
            start = text[:8]
            if start.startswith((_EXR, _PNG, *_TIFF)) and size:
                # Not at the beginning if there is much else that the image tells of itself.
                with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as whole:
                    marked = _IN_IMAGE.search(text) or _IN_IMAGE.search(whole)
                return marked is not None or (start.startswith(_EXR) and size < _LEAST_EXR)
            if start.startswith(_ARCHIVE):
                with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as whole:
                    return whole.rfind(_IN_ARCHIVE) >= 0
    except FileNotFoundError:
        # A link that leads nowhere.
        return True
    except OSError:
        return False
    if size == 0:
        return True
    if start == _CRATE and _is_cut_short(path, size):
        return True
    if start == _CRATE or start.startswith(_LAYER):
        from vrtm.bake.mark import is_marked_file

        return is_marked_file(path)
    if start.startswith(b"glTF"):
        return text[20:].startswith(_GLTF)
    return b"".join(text[: 1 << 10].split()).startswith(_REPORT)


def remove_damaged(path: str, read: Callable[[str], object]) -> None:
    """Takes a file of vrtm's own away of which `read` makes None, so that no program takes it for a whole one."""
    if os.path.isfile(path) and is_ours(path) and read(path) is None:
        with contextlib.suppress(OSError):
            os.remove(path)


def _is_cut_short(path: str, size: int) -> bool:
    """True if a USD crate lacks its end, without which nothing reads it: the table of contents, whose place is the
    third number of the file, and which begins with the number of its entries, of 32 bytes each."""
    with open(path, "rb") as file:
        file.seek(16)
        place = int.from_bytes(file.read(8), "little")
        if not 24 <= place < size:
            return True
        file.seek(place)
        return size < place + 8 + 32 * int.from_bytes(file.read(8), "little")


def _keys(path: str, folders: dict[str, str]) -> list[object]:
    """Keys of a path; paths of the same file share one. `folders`: real paths of folders that were met."""
    folder, name = os.path.split(path)
    if folder not in folders:
        folders[folder] = os.path.realpath(folder or ".")
    keys: list[object] = [os.path.join(folders[folder], name).casefold()]
    try:
        if os.path.islink(path):
            keys.append(os.path.realpath(path).casefold())
        found = os.stat(path)
        # Some file systems do not number their files.
        if stat.S_ISREG(found.st_mode) and found.st_ino:
            keys.append((found.st_dev, found.st_ino))
    except OSError:
        pass
    return keys
