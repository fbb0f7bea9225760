"""Tokens of a frame or a tile in the names of files, as the programs write them that make such files."""

import re

FRAME = re.compile(r"#+|@+|%0?(\d*)d|\$F(\d*)|\$\{F(\d*)\}|(?i:<f(?:rame)?(\d*)>)")
"""A frame's number; the group, or the letters' count, is how many digits it has at least."""
FRAMES = "####, @@@@, %04d, $F4 and <frame>"
"""The tokens of frames, for messages."""
TILES = "<UDIM>, <UVTILE>, u<U>_v<V> and %(UDIM)d"
"""The same for tiles."""

# <UDIM> as in all programs; <UVTILE>, <U>, <u> and %(UDIM)d as in OpenImageIO, the first of them also in MaterialX;
# u<U>_v<V> as in Maya; %(UVTILE)d, %(U)d as in Houdini.
_TILE = re.compile(
    r"(?P<letter>(?<![A-Za-z])[uUvV])?<(?P<axis>[uUvV])>|<(?P<name>(?i:udim)|UVTILE|uvtile)>"
    r"|%\((?P<printf>UDIM|UVTILE|U|V)\)(?P<width>\d*)d"
)
_SEPARATED = re.compile(rf"[._-]*(?:{_TILE.pattern})|[._-]*<(?:mesh|subset)>")


def digits(token: re.Match[str]) -> int:
    """Least number of digits of a frame's number, for a match of `FRAME`."""
    letters = len(token[0]) if token[0][0] in "#@" else 0
    return letters or int(next(filter(None, token.groups()), 1))


def has_tile(pattern: str) -> bool:
    """True if a pattern has a token of the tile."""
    return _TILE.search(pattern) is not None


def tiled(pattern: str, udim: int) -> str:
    """A pattern with a tile's number in the place of its tokens. <UVTILE>, <U> and <V> count columns and rows from 1,
    <uvtile>, <u> and <v> from 0."""
    row, column = divmod(udim - 1001, 10)

    def filled(token: re.Match[str]) -> str:
        name = token["name"] or token["printf"] or token["axis"]
        if name.upper() == "UDIM":
            return str(udim)
        first = int(name.isupper())
        width = int(token["width"] or 0)
        u, v = (f"{number + first:0{width}}" for number in (column, row))
        if name.upper() == "UVTILE":
            return f"u{u}_v{v}"
        number = u if name in "uU" else v
        # OpenImageIO's tokens bring a letter if none is written.
        return number if token["printf"] else (token["letter"] or name.lower()) + number

    return _TILE.sub(filled, pattern)


def with_tiles(pattern: str, text: str) -> str:
    """A pattern with a text in the place of its tokens of the tile."""
    return _TILE.sub(lambda _: text, pattern)


def bare(name: str) -> str:
    """A name without tokens of tile, mesh and subset, and without what separates them."""
    return _SEPARATED.sub("", name)
