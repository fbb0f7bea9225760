"""Parts of sentences."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def near(name: str, among: Iterable[str]) -> str:
    """The end of a sentence that says that there is no such name: the nearest ones that there are; empty if none is."""
    known = {other.lower(): other for other in among}
    found = [known[other] for other in difflib.get_close_matches(name.lower(), known, 2, 0.75)]
    return f": did you mean {' or '.join(found)}?" if found else ""


def others(count: int) -> str:
    """What follows the first of several meshes."""
    return "" if count == 0 else " and another mesh" if count == 1 else f" and {count} other meshes"
