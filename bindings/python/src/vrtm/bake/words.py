"""Parts of sentences."""

import difflib
from collections.abc import Collection, Iterable

from vrtm.bake import frames
from vrtm.bake.frames import Frame

_LONGEST = 400
"""Letters of what a library says, which may quote the rest of a file."""


def near(name: str, among: Iterable[str]) -> str:
    """The end of a sentence that says that there is no such name: the nearest ones that there are; empty if none is."""
    known = {other.lower(): other for other in among}
    found = [known[other] for other in difflib.get_close_matches(name.lower(), known, 2, 0.75)]
    return f": did you mean {' or '.join(found)}?" if found else ""


def counted(count: int, noun: str) -> str:
    """So many of something: `1 file`, `2 files`."""
    return f"{count} {noun}{'s' if count != 1 else ''}"


def numbered(noun: str, numbers: Collection[Frame]) -> str:
    """Frames or tiles by their numbers: `frame 3`, `frames 1-3,7`; empty without any."""
    return f"{noun}{'s'[: len(set(numbers)) > 1]} {frames.text(numbers)}" if numbers else ""


def others(count: int) -> str:
    """The words behind the first of several meshes."""
    return "" if count == 0 else " and another mesh" if count == 1 else f" and {count} other meshes"


def cause(error: Exception) -> str:
    """The message of a library's exception, in one line. That of a Tf.ErrorException has a line for each of USD's
    functions that it passed: the first one names the cause, and its place in USD's sources."""
    try:
        told = str(error)
    except UnicodeDecodeError as wrong:
        # USD quotes the file.
        told = wrong.object.decode(errors="backslashreplace")
    first = told.strip().split("\n")[0]
    if " : '" in first:
        told = first.rsplit(" : '", 1)[-1].rstrip("'")
    return " ".join(told.split())[:_LONGEST] or type(error).__name__
