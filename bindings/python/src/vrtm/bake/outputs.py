"""The kinds of files that are written per frame and tile, straight from the library."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vrtm.bake.settings import Settings

FETCH = {"tile": "redirection", "udim": "redirection_udim", "delta": "redirection_delta"}
"""The library's names of the forms of redirections."""
_OF_SET = {"udim": "uv_set", "delta": "uv_set_delta"}
"""The same, as UVs of the set that textures are looked up by."""
_RGB = ("R", "G", "B")
_RGBA = ("R", "G", "B", "A")


@dataclass(frozen=True)
class Output:
    """One kind of file."""

    kind: str
    """Its name in file names and metadata."""
    form: str | None
    """How its UVs are meant, if it holds UVs."""
    fetch: str
    """The library's name of it."""
    fetched: int
    """Channels of the image that is fetched."""
    channels: tuple[str, ...]
    """Channels of the file: as many, or all alike."""
    dtype: str

    def image(self, tile, size: tuple[int, int]) -> np.ndarray:
        """(height, width, channels) of a tile that is solved, the first row at the top."""
        pixels = tile.fetch(
            self.fetch,
            size,
            dtype=np.dtype(self.dtype).type,
            channels=self.fetched,
            uv_set=int(self.fetch in _OF_SET.values()),
        )
        return np.broadcast_to(pixels, (*pixels.shape[:2], len(self.channels))) if self.fetched == 1 else pixels


def listed(settings: Settings) -> tuple[Output, ...]:
    """The kinds that are asked for; the first is the redirection."""
    dtype = "float16" if settings.half else "float32"

    def of(kind: str, form: str | None, fetch: str, fetched: int, channels: tuple[str, ...]) -> Output:
        return Output(kind, form, fetch, fetched, channels, dtype)

    channels = _RGBA if settings.alpha else _RGB
    fetch = (FETCH if settings.options.texture_uv is None else _OF_SET)[settings.form]
    outputs = [of("redirect", settings.form, fetch, len(channels), channels)]
    if settings.warp:
        outputs.append(of("warp", "tile", "warp", 3, _RGB))
    if settings.jacobian:
        outputs.append(of("jacobian", None, "jacobian", 4, _RGBA))
    if settings.filter_scale:
        # Three times the same number: programs that read one channel alone show it as red, or not at all.
        outputs.append(of("filter", None, "filter_scale", 1, _RGB))
    return tuple(outputs)
