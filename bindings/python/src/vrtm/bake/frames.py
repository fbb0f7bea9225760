"""Lists of frames and tiles as text: `1-10x2,15`. A frame is an int, or a float where it is none: one between two."""

import re
from collections.abc import Iterable, Sequence
from fractions import Fraction

Frame = int | float

_NUMBER = r"-?\d+(?:\.\d+)?"
_RANGE = re.compile(rf"({_NUMBER})(?:(?:-|\s+-\s+)({_NUMBER}))?(?:\s*[x:]\s*(\d+(?:\.\d+)?))?")
_BETWEEN = re.compile(r",|(?<=\d)\s+(?=\d)")
"""Separators of the parts of a list. A blank on one side of a hyphen alone has two readings, and is refused."""
_LONGEST = 10_000_000
MOST = 100_000
"""Frames that are baked without being named: an hour, and ten minutes."""


def parse(text: str) -> tuple[Frame, ...]:
    """The numbers of a list: commas or blanks between numbers and ranges, `first-last`, with a step behind
    an x or a colon, `first-lastxstep`. Sorted, each once. Raises ValueError, naming the part that is wrong."""
    numbers: set[Fraction] = set()
    for part in map(str.strip, _BETWEEN.split(text)):
        match = _RANGE.fullmatch(part)
        if match is None:
            raise ValueError(f"'{part}' is neither a number nor a range such as 1-10 or 1-10x2")
        # Exact, so that a step of 0.1 meets the whole numbers.
        first, last = Fraction(match[1]), Fraction(match[2] or match[1])
        step = Fraction(match[3] or 1)
        if last < first:
            raise ValueError(f"'{part}' runs backwards")
        if step == 0:
            raise ValueError(f"'{part}' has a step of 0")
        count = (last - first) // step + 1
        if count > _LONGEST:
            raise ValueError(f"'{part}' is longer than {_LONGEST} numbers")
        numbers.update(first + step * index for index in range(count))
    return tuple(map(_frame, sorted(numbers)))


def parse_whole(text: str) -> tuple[int, ...]:
    """The same for what has whole numbers alone, as tiles."""
    found = parse(text)
    for number in found:
        if not isinstance(number, int):
            raise ValueError(f"{number} is not a whole number")
    return tuple(int(number) for number in found)


def _frame(number: Fraction) -> Frame:
    return int(number) if number.denominator == 1 else float(number)


def text(numbers: Iterable[Frame]) -> str:
    """A list as text again, with ranges where whole numbers follow one another."""
    if isinstance(numbers, range) and len(numbers) > 1:
        return f"{numbers[0]}-{numbers[-1]}"
    parts: list[list[Frame]] = []
    for number in sorted(set(numbers)):
        if parts and isinstance(number, int) and number == parts[-1][1] + 1:
            parts[-1][1] = number
        else:
            parts.append([number, number])
    return ",".join(str(first) if first == last else f"{first}-{last}" for first, last in parts)


def padded(frame: Frame) -> str:
    """A frame in a file's name: at least four digits before the point, the minus sign being none of them."""
    whole, point, rest = str(abs(frame)).partition(".")
    return "-" * (frame < 0) + whole.zfill(4) + point + rest


def clamp(
    wanted: Sequence[Frame] | None, present: Sequence[int], between: bool = False
) -> tuple[tuple[Frame, ...], tuple[Frame, ...]]:
    """The frames of a list that the scene has, and those that it lacks. None: all frames of the scene. `between`:
    whether it has what lies between two of its frames. Raises ValueError for too many."""
    if wanted is None:
        if len(present) > MOST:
            raise ValueError(f"{len(present)} frames, {text(present)}, are more than {MOST}: --frames says which")
        return tuple(present), ()
    there = present if isinstance(present, range) else set(present)

    def has(frame: Frame) -> bool:
        if isinstance(frame, int):
            return frame in there
        return between and present[0] <= frame <= present[-1]

    return tuple(filter(has, wanted)), tuple(frame for frame in wanted if not has(frame))
