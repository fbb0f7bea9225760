"""Lists of frames and tiles as text: `1-10x2,15`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

_RANGE = re.compile(r"(-?\d+)(?:-(-?\d+))?(?:[x:](\d+))?")
_LONGEST = 10_000_000


def parse(text: str) -> tuple[int, ...]:
    """The numbers of a list: commas between numbers and ranges, `first-last`, with a step as `first-last x step` (also
    written with a colon). Sorted, each once. Raises ValueError, naming the part that is wrong."""
    numbers: set[int] = set()
    for part in text.split(","):
        match = _RANGE.fullmatch("".join(part.split()))
        if match is None:
            raise ValueError(f"'{part.strip()}' is neither a number nor a range such as 1-10 or 1-10x2")
        first, last = int(match[1]), int(match[2] or match[1])
        step = int(match[3] or 1)
        if last < first:
            raise ValueError(f"'{part.strip()}' runs backwards")
        if step == 0:
            raise ValueError(f"'{part.strip()}' has a step of 0")
        if last - first >= _LONGEST:
            raise ValueError(f"'{part.strip()}' is longer than {_LONGEST} numbers")
        numbers.update(range(first, last + 1, step))
    return tuple(sorted(numbers))


def text(numbers: Iterable[int]) -> str:
    """A list as text again, with ranges where numbers follow one another."""
    parts: list[list[int]] = []
    for number in sorted(set(numbers)):
        if parts and number == parts[-1][1] + 1:
            parts[-1][1] = number
        else:
            parts.append([number, number])
    return ",".join(str(first) if first == last else f"{first}-{last}" for first, last in parts)


def clamp(wanted: Sequence[int] | None, present: Sequence[int]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The frames of a list that the scene has, and those that it lacks. None: all frames of the scene."""
    if wanted is None:
        return tuple(present), ()
    there = set(present)
    return tuple(f for f in wanted if f in there), tuple(f for f in wanted if f not in there)
