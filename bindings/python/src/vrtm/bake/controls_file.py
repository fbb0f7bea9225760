"""The values of a rig's controls in the frames of a scene, from a table."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vrtm.bake import frames
from vrtm.bake.failure import INPUT, Failure, one_line
from vrtm.bake.frames import Frame


@dataclass(frozen=True, eq=False)
class Controls:
    """A row of numbers per frame."""

    path: str
    names: tuple[str, ...]
    rows: dict[Frame, tuple[float, ...]]

    def of(self, wanted: Sequence[Frame]) -> np.ndarray:
        """(frames, controls). Raises Failure for a frame that the table lacks."""
        lacking = [frame for frame in wanted if frame not in self.rows]
        if lacking:
            raise Failure(INPUT, f"--controls {self.path}: no row for frame {frames.text(lacking)}")
        return np.array([self.rows[frame] for frame in wanted]).reshape(len(wanted), len(self.names))


def read(path: str) -> Controls:
    """Reads comma-separated values: a first line `frame,smile,jaw`, and a line of numbers per frame. Raises Failure."""

    def bad(line: int, reason: str) -> Failure:
        return Failure(INPUT, f"--controls {path}:{line}: {reason}")

    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            table = [(n, [cell.strip() for cell in row]) for n, row in enumerate(csv.reader(file), 1) if any(row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise Failure(INPUT, f"--controls {path}: {one_line(getattr(error, 'strerror', None) or error)}") from error
    if not table or table[0][1][0].lower() != "frame" or len(table[0][1]) < 2:
        raise bad(1, "the first line must be 'frame', and the names of the controls, with commas between them")
    names = tuple(table[0][1][1:])
    if len(set(names)) < len(names) or "" in names:
        raise bad(1, "each control needs a name of its own")
    rows: dict[Frame, tuple[float, ...]] = {}
    for line, (first, *cells) in table[1:]:
        try:
            [frame] = frames.parse(first)
            values = tuple(map(float, cells))
        except ValueError:
            raise bad(line, f"'{','.join([first, *cells])}' is not a frame and numbers") from None
        if len(values) != len(names) or not all(map(math.isfinite, values)):
            raise bad(line, f"{len(names)} finite numbers are needed, one per control")
        if frame in rows:
            raise bad(line, f"frame {first} is there twice")
        rows[frame] = values
    return Controls(path, names, rows)
