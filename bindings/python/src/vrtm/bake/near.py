"""Names that are near to one that does not exist."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def near(name: str, among: Iterable[str]) -> str:
    """The end of a sentence that says that there is no such name: the nearest ones that there are; empty if none is."""
    known = {other.lower(): other for other in among}
    found = [known[other] for other in difflib.get_close_matches(name.lower(), known, 2, 0.75)]
    return f": did you mean {' or '.join(found)}?" if found else ""
