"""How long a bake goes on."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping

_LEAST = 10.0
"""Seconds: of less nothing is said."""


class TimeLeft:
    """An estimate by mesh, since frames of one mesh take about as long, and those of another may take a hundredth."""

    def __init__(self, meshes: Iterable[str], sizes: Mapping[str, float]) -> None:
        """`meshes`: the mesh of each frame that is to be done. `sizes`: what a frame of a mesh is expected to take, to
        any scale, until one is done."""
        self._left = Counter(meshes)
        self._sizes = sizes
        self._done: Counter[str] = Counter()
        self._spent: defaultdict[str, float] = defaultdict(float)

    def done(self, mesh: str, seconds: float) -> None:
        """A frame of a mesh is done, for which a job worked so long."""
        self._left[mesh] -= 1
        self._done[mesh] += 1
        self._spent[mesh] += seconds

    def seconds(self, elapsed: float) -> float:
        """How long the frames that are left will take, if those that are done took `elapsed` all together, side by side
        as they were."""
        worked = sum(self._spent.values())
        if not worked:
            return 0.0
        scale = worked / sum(self._sizes[mesh] * count for mesh, count in self._done.items())

        def expected(mesh: str) -> float:
            return self._spent[mesh] / self._done[mesh] if self._done[mesh] else self._sizes[mesh] * scale

        return elapsed / worked * sum(count * expected(mesh) for mesh, count in self._left.items() if count)

    def text(self, elapsed: float) -> str:
        """The same as the end of a line; empty if it is not worth a word."""
        seconds = self.seconds(elapsed)
        if seconds < _LEAST:
            return ""
        if seconds < 90:
            return f", about {5 * round(seconds / 5)} s left"
        minutes = round(seconds / 60)
        return f", about {minutes} min left" if minutes < 90 else f", about {seconds / 3600:.1f} h left"
