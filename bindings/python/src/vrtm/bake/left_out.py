"""The list of what is not baked, and why: on the screen, in the log and in the report; `--strict` makes it an error.

To add an entry, append a `LeftOut` to the list that is nearest, and give no warning beside it: the bake tells all.

- A reader of scenes has `left_out` beside `warnings`: `self.left_out.append(LeftOut("has no UVs", path))`.
- What `Work` leaves out of a scene that is open goes to its `left_out`.
- What is noticed in a frame goes to the `left_out` of its `FrameResult`, with the frame; frames that lack the same for
  the same reason are told as one.

Nothing that depends on a frame or names the mesh belongs into `why`: entries with equal words are told together.
"""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace

from vrtm.bake.frames import Frame
from vrtm.bake.words import numbered, others

_TOLD = 50
"""Lines on the screen; the log and the report have all."""


@dataclass(frozen=True)
class LeftOut:
    """Something that gets no maps."""

    why: str
    """The end of the sentence, behind the mesh and a colon: `has no UVs`, `not in --frames`."""
    mesh: str = ""
    """Its path, that of a prim that could not be read, or of one of its subsets as messages name it; empty: all."""
    frames: tuple[Frame, ...] = ()
    """Empty: all."""
    tiles: tuple[int, ...] = ()
    """Numbers of UDIM tiles; empty: all."""
    layers: tuple[int, ...] = ()
    """Of charts that lie over one another; empty: all."""
    meant: bool = False
    """True if `--strict` lets it pass: an option asks for it, or maps would change nothing that a renderer shows. All
    else is also warned of as soon as it is known."""

    def line(self, more: int = 0) -> str:
        """A sentence; `more`: how many other meshes it is said of."""
        numbers = {"tile": self.tiles, "layer": self.layers, "frame": self.frames}
        parts = [self.mesh + others(more), *(numbered(noun, of) for noun, of in numbers.items())]
        return ": ".join(filter(None, [", ".join(filter(None, parts)), self.why]))

    def row(self) -> dict:
        return asdict(self) | {"mesh": self.mesh or None}


def merged(entries: Iterable[LeftOut]) -> list[LeftOut]:
    """Entries with one for all frames of a mesh and its tiles, in the order of the first of each."""
    found: dict[LeftOut, list[tuple[Frame, ...]]] = {}
    for entry in entries:
        found.setdefault(replace(entry, frames=()), []).append(entry.frames)
    # An entry for all frames includes the others.
    every = {entry: () if () in of else tuple(sorted(set().union(*of))) for entry, of in found.items()}
    return [replace(entry, frames=numbers) for entry, numbers in every.items()]


def lines(entries: Iterable[LeftOut]) -> list[str]:
    """A sentence for each, but one for all meshes that the same is said of."""
    groups: dict[tuple, list[LeftOut]] = {}
    for entry in merged(entries):
        groups.setdefault((entry.why, entry.frames, entry.tiles, entry.layers), []).append(entry)
    return [first.line(len(more)) for first, *more in groups.values()]


def listed(entries: Iterable[LeftOut]) -> list[str]:
    """The list as the screen shows it; nothing if nothing is left out."""
    found = lines(entries)
    further = [f"  and {len(found) - _TOLD} more, which the log and the report name"] if len(found) > _TOLD else []
    return ["not baked:", *(f"  {line}" for line in found[:_TOLD]), *further] if found else []


def unmeant(entries: Iterable[LeftOut]) -> list[LeftOut]:
    """The entries that `--strict` makes an error."""
    return [entry for entry in entries if not entry.meant]
