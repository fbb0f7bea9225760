"""The sheet's lower left quarter: bars of strain, a tile's texture as painted and as looked up, and the legend of the
strain's colours. Bars and textures share the room above the legend."""

from collections.abc import Callable, Sequence

import numpy as np

Text = tuple[int, int, int, str]
"""Left, baseline, size in pixels, and the words."""
Tile = tuple[str, dict]
"""A tile's name, and its strain as in the report."""

QUIET = (0.16, 0.16, 0.165)
"""Colour of elastic material in pictures of strain, and of bars of strain with the original UVs."""
GOLD = (0.90, 0.62, 0.24)
_WHITE = (0.92, 0.92, 0.92)
_STRETCH, _SQUEEZE, _SHEAR = (0.72, 0.015, 0.020), (0.020, 0.085, 0.72), (0.24, 0.015, 0.40)
_FULL = 0.30
"""The strain whose colour is full."""

_SWATCH, _LINE, _SPACE = 18, 24, 14
"""Heights in pixels of a colour of the legend, of a line of text, and of the space between two parts."""
_PAIR, _TALL = 24, 32
"""Least height of a pair of bars, and the one from which further kinds of strain have bars of their own."""
_NAME, _VALUES = 140, 130
"""Widths in pixels of the bars' names and values."""
_KINDS = ("RMS", "95 % below", "99 % below", "largest")


def draw(
    sheet: np.ndarray,
    box: tuple[int, int, int, int],
    tiles: Sequence[Tile],
    textures: Callable[[int], Sequence[np.ndarray]] | None,
) -> list[Text]:
    """Fills a box (left, top, width, height) of the sheet, and returns its texts. `textures` draws squares of so many
    pixels on a side."""
    left, top, width, height = box
    bottom = top + height - 2 * (_SWATCH + _LINE)
    texts = _legend(sheet, (left, bottom), width)
    bottom -= _SPACE
    side = min((width - _SPACE) // 2, bottom - top - _LINE) if textures is not None else 0
    if textures is not None and side > 0:
        bottom -= side + _LINE
        for x, picture, name in zip(
            (left, left + width - side), textures(side), ("texture as painted", "texture as it is looked up")
        ):
            sheet[bottom : bottom + side, x : x + side] = picture
            texts.append((x, bottom + side + 18, 16, name))
        bottom -= _SPACE
    return texts + _bars(sheet, (left, top), (width, bottom - top - _LINE), tiles)


def _bars(sheet: np.ndarray, corner: tuple[int, int], size: tuple[int, int], tiles: Sequence[Tile]) -> list[Text]:
    """A pair of bars for each tile and kind of strain, of as many as there is room for."""
    (left, top), (width, height) = corner, size
    shown = [(name, strain) for name, strain in tiles if strain["segments"]][: max(height // _PAIR, 0)]
    length = width - _NAME - _VALUES
    if not shown or length <= 0:
        return []
    count = min(max(height // _TALL // len(shown), 1), len(_KINDS))
    every = ((name, *pair) for name, strain in shown for pair in zip(_KINDS[:count], _values(strain)))
    rows = [(f"{name} {kind}" if len(tiles) > 1 else kind, values) for name, kind, values in every]
    start, most = left + _NAME, max(max(values) for _, values in rows) or 1.0
    texts: list[Text] = [(left, top + 14, 16, "strain")]
    for x, colour, name in ((start, QUIET, "original UVs"), (start + 140, GOLD, "vrtm")):
        sheet[top + 2 : top + 14, x : x + 12] = colour
        texts.append((x + 20, top + 14, 16, name))
    for k, (name, values) in enumerate(rows):
        begin, end = (top + _LINE + height * row // len(rows) for row in (k, k + 1))
        bar = (end - begin - 6) // 2
        for y, value, colour in ((begin, values[0], QUIET), (begin + bar, values[1], GOLD)):
            sheet[y : y + bar, start : start + max(round(length * value / most), 1)] = colour
        texts.append((left, begin + bar + 5, 16, name))
        texts.append((left + width - _VALUES + 12, begin + bar + 5, 16, f"{values[0]:.3f} -> {values[1]:.3f}"))
    return texts


def _values(strain: dict) -> list[tuple[float, float]]:
    """Of each kind, without the warp and with it. The RMS is that of all rigid segments, the others of those that may
    move."""
    movable = [strain["movable"][side] for side in ("before", "after")]
    rms = (strain["before"]["rms"], strain["after"]["rms"])
    return [rms, *((movable[0][key], movable[1][key]) for key in ("p95", "p99", "max"))]


def _legend(sheet: np.ndarray, corner: tuple[int, int], width: int) -> list[Text]:
    (left, top), half = corner, (width - _SPACE) // 2
    ramp = np.linspace(-_FULL, _FULL, width)
    for x, row, colour in (
        (left, 0, strain_colour(ramp.clip(0), (-ramp).clip(0))),
        (left, 1, np.full((half, 3), _SHEAR)),
        (left + width - half, 1, np.full((half, 3), QUIET)),
    ):
        y = top + row * (_SWATCH + _LINE)
        sheet[y : y + _SWATCH, x : x + len(colour)] = colour
    return [
        (left + x, top + row * (_SWATCH + _LINE) + _SWATCH + 17, 16, text)
        for x, row, text in (
            (0, 0, f"squeezed by {_FULL:.0%}"),
            (width // 2 - 5, 0, "0"),
            (width - 134, 0, f"stretched by {_FULL:.0%}"),
            (0, 1, "both (sheared)"),
            (width - half, 1, "elastic, or not baked"),
        )
    ]


def strain_colour(stretch: np.ndarray, squeeze: np.ndarray) -> np.ndarray:
    """White for none, red for stretched, blue for squeezed, violet for both."""
    a, b = ((value / _FULL).clip(0, 1)[:, None] for value in (stretch, squeeze))
    return mix(mix(_WHITE, _STRETCH, a), mix(_SQUEEZE, _SHEAR, a), b)


def mix(a: object, b: object, t: np.ndarray) -> np.ndarray:
    """(points, channels) between two colours, by shares (points, 1)."""
    a, b = np.asarray(a), np.asarray(b)
    return a + (b - a) * t
