"""The files of a sequence of poses, by frame. docs/bake.md has the rules, which follow the library fileseq."""

import glob
import os
import re
from collections.abc import Iterable

from vrtm.bake.left_out import LeftOut
from vrtm.bake.scene.types import SceneError
from vrtm.bake.tokens import FRAME, FRAMES, digits
from vrtm.bake.words import near

_NUMBER = re.compile(r"(-?[0-9]+)")
_UNSIGNED = re.compile(r"([0-9]+)")
_WILDCARD = re.compile(r"\*|\?|\[(!?)([^\]]+)\]")
_LETTER = re.compile(r"[A-Za-z0-9]")
"""Behind one of these a hyphen may be a minus sign or not."""


def find_poses(
    patterns: tuple[str, ...], warnings: list[str] | None = None, left_out: list[LeftOut] | None = None
) -> dict[int, str]:
    """Files by frame. The frame is what a token (`####`, `%04d`, `$F4`, `<frame>` and the like) stands for; of other
    files it is the only number in which they differ, else the file's place in the list, from 1. Raises SceneError where
    that leaves two readings."""
    warnings = [] if warnings is None else warnings
    left_out = [] if left_out is None else left_out
    numbered: dict[int, str] = {}
    listed: list[str] = []
    globs: list[str] = []
    for pattern in patterns:
        if os.path.exists(pattern):
            listed.append(pattern)
            continue
        token = _token(pattern)
        if token is not None:
            _merge(numbered, _sequence(pattern, token, warnings, left_out))
            continue
        found = sorted(glob.glob(pattern))
        if not found:
            raise SceneError(f"{pattern}: no such file{_hint(pattern)}")
        globs.append(pattern)
        listed += found
    if numbered and listed:
        raise SceneError(f"{listed[0]}: files that are listed cannot be mixed with patterns of frames")
    return numbered or _of_list(listed, globs, warnings)


def _merge(into: dict[int, str], found: Iterable[tuple[int, str]]) -> dict[int, str]:
    for frame, path in found:
        if into.setdefault(frame, path) != path:
            raise SceneError(f"{path}: frame {frame} is already {into[frame]}")
    return into


def _hint(pattern: str) -> str:
    """The end of a sentence that says that there is no file of a pattern."""
    folder, name = os.path.split(pattern)
    tokens = f"; tokens of a frame are {FRAMES}" if re.search(r"[<>${}%]", name) else ""
    return tokens or (near(name, os.listdir(folder or ".")) if os.path.isdir(folder or ".") else "")


def _folders(pattern: str) -> int:
    """Length of the part of a pattern that is an existing folder, whatever letters its name has."""
    ends = [slash.end() for slash in re.finditer(r"[/\\]", pattern)]
    return max((end for end in ends if os.path.isdir(pattern[:end])), default=0)


def _token(pattern: str) -> re.Match[str] | None:
    """The token of the frame in a pattern; None if it has none. Raises SceneError if it has several."""
    found = list(FRAME.finditer(pattern, _folders(pattern)))
    if len(found) > 1:
        # A single # or @ may be part of a name.
        found = [token for token in found if token[0] not in ("#", "@")] or found
    if len(found) > 1:
        tokens = " and ".join(token[0] for token in found)
        raise SceneError(f"{pattern}: {tokens} both stand for the frame: write one of them, and * for the other")
    return found[0] if found else None


def _sequence(
    pattern: str, token: re.Match[str], warnings: list[str], left_out: list[LeftOut]
) -> list[tuple[int, str]]:
    """(frame, file) of the files whose number stands where the pattern has its token."""
    width, start = digits(token), _folders(pattern)
    before, after = pattern[start : token.start()], pattern[token.end() :]
    sign = "-?"
    if before.endswith("-"):
        # Behind a letter or a digit a hyphen that is written is one; else it is the minus sign.
        sign = "" if _LETTER.fullmatch(before[-2:-1]) else "-"
        before = before.removesuffix("-") if sign else before
    there = sorted(glob.glob(f"{glob.escape(pattern[:start] + before)}*{glob.escape(after)}"))
    regex = re.escape if there else _regex
    fits = re.compile(f"{regex(before)}({sign}[0-9]+){regex(after)}")
    found: list[tuple[int, str]] = []
    others: dict[int, str] = {}
    unclear: list[int] = []
    # Brackets may be letters of a name.
    for path in there or sorted(glob.glob(f"{glob.escape(pattern[:start])}{before}*{after}")):
        match = fits.fullmatch(path, start)
        if match is None:
            continue
        body = match[1].removeprefix("-")
        # A longer number has no zeros in front. To printf and fileseq the minus sign is one of the digits.
        if width > 1 and width not in (len(body), len(match[1])) and (len(body) < width or body[0] == "0"):
            others[int(match[1])] = path
            continue
        found.append((int(match[1]), path))
        unclear += [match.start(1)] if _is_unclear(path, match.start(1)) else []
    odd = next(iter(others.values()), "")
    if not found:
        but = f", but {odd}, whose number has other digits than {token[0]}" if odd else ""
        raise SceneError(f"{pattern}: no such files{but or _hint(pattern[: token.start()] + '0001' + after)}")
    lost = tuple(sorted(set(others) - {frame for frame, _ in found}))
    if lost:
        # A file beside one with the right digits is another sequence's.
        left_out.append(LeftOut(f"files such as {odd} have numbers with other digits than {token[0]}", frames=lost))
    if len(unclear) == len(found):
        frame, path = found[0]
        if re.search(r"[*?\]]$", before):
            raise _both_ways(path, unclear[0])
        warnings.append(f"{path}: taken for frame {frame}: write a hyphen before {token[0]} if it is no minus sign")
    return found


def _is_unclear(path: str, number: int) -> bool:
    """True if a number has a hyphen before it that may be its minus sign or not."""
    return path[number] == "-" and _LETTER.fullmatch(path[max(number - 1, 0)]) is not None


def _both_ways(path: str, start: int) -> SceneError:
    found = _NUMBER.match(path, start)
    assert found is not None
    before, after, token = path[:start], path[found.end() :], "#" * (len(found[0]) - 1)
    return SceneError(
        f"{path}: frame {int(found[0])}, or {-int(found[0])}? Write {before}-{token}{after} if the hyphen is no minus "
        f"sign, else {before}{token}{after}"
    )


def _regex(pattern: str) -> str:
    """A regular expression for a part of a pattern with wildcards."""
    parts, end = [], 0
    for wild in _WILDCARD.finditer(pattern):
        parts.append(re.escape(pattern[end : wild.start()]))
        inside = f"[{'^' * bool(wild[1])}{wild[2]}]" if wild[2] else ""
        parts.append({"*": "[^/]*?", "?": "[^/]"}.get(wild[0], inside))
        end = wild.end()
    return "".join(parts) + re.escape(pattern[end:])


def _of_list(paths: list[str], globs: list[str], warnings: list[str]) -> dict[int, str]:
    """Files that are listed, or that wildcards found (`globs`)."""
    # A hyphen that is written before a wildcard is none of the number's.
    number = _UNSIGNED if any(re.search(r"[A-Za-z0-9]-[*?[]", pattern) for pattern in globs) else _NUMBER
    rows = [number.split(path) for path in paths]
    odd = next((path for path, row in zip(paths, rows) if row[::2] != rows[0][::2]), None)
    if odd is not None:
        return _of_others(paths, odd, globs, warnings)
    columns = [column for column in range(1, len(rows[0]), 2) if len({row[column] for row in rows}) > 1]
    if len(columns) > 1:
        numbers = " and ".join(rows[0][column] for column in columns)
        raise SceneError(f"{paths[0]}: which of {numbers} is the frame? Write a token in its place, such as ####")
    if not columns and len(paths) == 1 and number.search(os.path.basename(paths[0])):
        columns = [len(rows[0]) - 2]
    if not columns and len(paths) == 1:
        return {1: paths[0]}
    if len(set(paths)) < len(paths):
        return _placed(paths, warnings)
    (column,) = columns
    starts = [len("".join(row[:column])) for row in rows]
    if all(map(_is_unclear, paths, starts)):
        raise _both_ways(paths[0], starts[0])
    return _merge({}, ((int(row[column]), path) for row, path in zip(rows, paths)))


def _of_others(paths: list[str], odd: str, globs: list[str], warnings: list[str]) -> dict[int, str]:
    """Files whose names differ in more than a number: by their last ones, else by their places."""
    starts = [len(path) - len(os.path.basename(path)) for path in paths]
    ends = [(list(_NUMBER.finditer(path, start)) or [None])[-1] for path, start in zip(paths, starts)]
    if not any(ends):
        return dict(enumerate(paths, 1))
    if globs:
        told = f"{globs[0]}: {paths[0]} and {odd} are not of one sequence"
        raise SceneError(f"{told}: write a token in the place of the frame, such as ####")
    for path, end in zip(paths, ends):
        if end and _is_unclear(path, end.start()):
            raise _both_ways(path, end.start())
    frames = {int(end[0]): path for end, path in zip(ends, paths) if end}
    return frames if len(frames) == len(paths) else _placed(paths, warnings)


def _placed(paths: list[str], warnings: list[str]) -> dict[int, str]:
    warnings.append(
        f"{paths[0]}: frames 1 to {len(paths)} are the files in the order in which they are listed, since not each of "
        "them has another number"
    )
    return dict(enumerate(paths, 1))
