"""Which file holds which pose of a sequence."""

from __future__ import annotations

import glob
import re
from pathlib import Path

from vrtm.bake.scene.types import SceneError


def find_poses(patterns: tuple[str, ...]) -> dict[int, str]:
    """Files by frame. The frame is what `####` or `%04d` stands for; of other files it is the last number of the name,
    if all files have one and no two the same, else the file's place in the list, from 1. Raises SceneError."""
    numbered: dict[int, str] = {}
    listed: list[str] = []
    for pattern in patterns:
        found = _sequence(pattern)
        if found is None:
            listed += _files(pattern)
            continue
        for frame, path in found.items():
            if numbered.setdefault(frame, path) != path:
                raise SceneError(f"{path}: frame {frame} is already {numbered[frame]}")
    if numbered and listed:
        raise SceneError(f"{listed[0]}: files that are listed cannot be mixed with patterns of frames")
    if numbered:
        return numbered
    ends = [re.search(r"(\d+)\D*$", Path(path).stem) for path in listed]
    frames = [int(end[1]) for end in ends if end]
    if len(set(frames)) != len(listed):
        frames = list(range(1, len(listed) + 1))
    return dict(zip(frames, listed))


def _files(pattern: str) -> list[str]:
    if Path(pattern).exists():
        return [pattern]
    found = sorted(glob.glob(pattern))
    if not found:
        raise SceneError(f"{pattern}: no such file")
    return found


def _sequence(pattern: str) -> dict[int, str] | None:
    """Files by the number that stands where the pattern has `####` or `%04d`; None if it has neither."""
    folder, name = str(Path(pattern).parent), Path(pattern).name
    token = re.search(r"#+|%(0?)(\d*)d", name)
    if not token:
        return None
    digits = len(token[0]) if token[0][0] == "#" else int(token[2] or 1)
    before, after = name[: token.start()], name[token.end() :]
    found: dict[int, str] = {}
    for path in glob.glob(str(Path(glob.escape(folder)) / f"{glob.escape(before)}*{glob.escape(after)}")):
        middle = Path(path).name[len(before) : len(Path(path).name) - len(after)]
        # A number longer than the token has no zeros in front.
        if re.fullmatch(r"-?\d+", middle) and (len(middle) == digits or (len(middle) > digits and middle[0] != "0")):
            found[int(middle)] = path
    if not found:
        raise SceneError(f"{pattern}: no such files")
    return found
