"""What USD says by itself: missing references, layers and clips, and whatever its libraries warn of. It would else go
to stderr in USD's own words, or get lost."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator

from pxr import UsdUtils

from vrtm.bake.left_out import LeftOut

_IN = re.compile(r"(?:In <([^>]*)>: )?(.*)", re.DOTALL)
_STAGE = re.compile(r"\s*\(\w+ stage .*\)$", re.DOTALL)
_MISSING = ("_ReportErrors", "_GetLayerForClip")
"""USD's functions that tell of what a stage lacks."""
_NO_FORMAT = "Cannot determine file format"
"""The reader says in better words which kinds of files USD does not open."""


@contextlib.contextmanager
def collected(said: list[LeftOut | str]) -> Iterator[None]:
    """Adds to `said` what USD says in the block, in all threads: what is missing, and warnings. Nothing is printed."""
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        for found in delegate.TakeUncoalescedDiagnostics():
            entry = _entry(found.commentary, found.sourceFunction)
            if entry not in said and _NO_FORMAT not in found.commentary:
                said.append(entry)


def _entry(text: str, function: str) -> LeftOut | str:
    place, what = _IN.fullmatch(_STAGE.sub("", text)).groups()
    what = f"USD: {' '.join(what.split())}"
    if function.endswith(_MISSING):
        return LeftOut(what, place or "")
    return f"{place}: {what}" if place else what
