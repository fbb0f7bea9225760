"""Carriers of the things that an object carries, and the connected parts of detail meshes among them. None of this
touches Blender's data: it takes arrays, on any thread."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from . import session

if TYPE_CHECKING:
    import vrtm

    from .geometry import Topology

# States of a carrier's points: on a chart, outside of all, in folded UVs, and too far from the surface.
BOUND, OUTSIDE, FOLDED, TOO_FAR = range(4)


@dataclass(frozen=True)
class Thing:
    """One carried object at rest."""

    uid: int
    name: str
    places: np.ndarray  # (places, 3) float64, in the skin's space
    to_skin: np.ndarray  # (4, 4) float64 from its own space to the skin's
    is_whole: bool  # carried as a whole
    farthest: float
    fit: str
    skirt: float
    # The connected part of each place, (places,): each part moves as one body. None: each place moves by itself.
    parts: np.ndarray | None = None

    @property
    def way(self) -> tuple[float, str, float]:
        # A skirt bends what it blends.
        return self.farthest, self.fit, self.skirt if self.parts is None else 0.0


@dataclass(frozen=True)
class CarriedInput:
    """All that an object carries, as it was read."""

    things: list[Thing]
    scale: float  # of the skin in the world, for words
    stamp: bytes


@dataclass(frozen=True)
class Moved:
    """The place of a carried object in a pose."""

    # As a whole: (4, 4) float64 from its own space to the skin's.
    matrix: np.ndarray | None = None
    # Else, in its own space, (places, 3) float64: places, and Euler angles (XYZ) of what was there at rest.
    places: np.ndarray | None = None
    turns: np.ndarray | None = None


class Carriers:
    """Carriers of an asset: one for all that is carried in the same way. `rest` has the skin's vertices, (vertices, 3).
    Raises vrtm.Error."""

    def __init__(self, asset: vrtm.Asset, given: CarriedInput, topology: Topology, rest: np.ndarray) -> None:
        self.things, self.scale = given.things, given.scale
        # By uid: the places that are bound, (roots, 3): all of them, or one for each part.
        self._roots = {thing.uid: thing.places for thing in given.things}
        for thing in [thing for thing in given.things if thing.parts is not None]:
            of = session.library("vrtm.bake.carry_parts")
            skin = of.Nearest(rest[topology.corner_vertices[topology.triangles]].astype(np.float64))
            self._roots[thing.uid] = of.feet(thing.places, thing.places, thing.parts, skin)
        # By uid: how each place is bound, (places,) int32.
        self.states: dict[int, np.ndarray] = {}
        self._groups: list[tuple[vrtm.Carrier, list[Thing]]] = []
        for way in dict.fromkeys(thing.way for thing in given.things):
            farthest, fit, skirt = way
            things = [thing for thing in given.things if thing.way == way]
            roots = np.concatenate([self._roots[thing.uid] for thing in things])
            carrier = asset.carrier(positions=roots, farthest=farthest, fit=fit, skirt=skirt)
            self._groups.append((carrier, things))
            for thing, states in self._split(things, carrier.states()):
                self.states[thing.uid] = states if thing.parts is None else states[thing.parts]

    def fetch(self) -> dict[int, Moved]:
        """All things in the pose that was solved last, by uid. Things that are too far stay as they are."""
        found = {}
        for carrier, things in self._groups:
            carried = carrier.fetch("positions", "matrices", dtype=np.float64)
            positions, matrices = (self._split(things, of) for of in (carried.positions, carried.matrices))
            for (thing, places), (_, turns) in zip(positions, matrices):
                if thing.parts is not None:
                    offsets = thing.places - self._roots[thing.uid][thing.parts]
                    turns = turns[thing.parts]
                    places = places[thing.parts] + np.einsum("nij,nj->ni", turns, offsets)
                far = self.states[thing.uid] == TOO_FAR
                places = np.where(far[:, None], thing.places, places)
                found[thing.uid] = _moved(thing, places, np.where(far[:, None, None], np.eye(3), turns))
        return found

    def figures(self) -> list[tuple[str, str]]:
        """Labels and values of the last fetch, for the panel."""
        if not self._groups:
            return []
        info = [carrier.info for carrier, _ in self._groups]
        number = sum(int((states != TOO_FAR).sum()) for states in self.states.values())
        return [("Carried", str(number)), ("Rims lift off", f"{self.scale * max(one.rim for one in info):.3g}")]

    def notes(self) -> list[str]:
        found = {thing.name: told(self.states[thing.uid], self.scale * thing.farthest) for thing in self.things}
        return [f"{name}: {text}" for name, text in found.items() if text]

    def _split(self, things: list[Thing], values: np.ndarray) -> list[tuple[Thing, np.ndarray]]:
        """Values of the roots of some things, thing by thing."""
        ends = np.cumsum([len(self._roots[thing.uid]) for thing in things])[:-1]
        return list(zip(things, np.split(values, ends)))

    def close(self) -> None:
        for carrier, _ in self._groups:
            carrier.close()


def _moved(thing: Thing, places: np.ndarray, turns: np.ndarray) -> Moved:
    """Places, (places, 3), and rotations of them, (places, 3, 3), both in the skin's space."""
    linear = thing.to_skin[:3, :3]
    if thing.is_whole:
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turns[0] @ linear, places[0]
        return Moved(matrix)
    # The rotation alone, without the scale.
    u, _, v = np.linalg.svd(linear)
    own = (places - thing.to_skin[:3, 3]) @ np.linalg.inv(linear).T
    return Moved(None, own, eulers((u @ v).T @ turns @ (u @ v)))


def eulers(turns: np.ndarray) -> np.ndarray:
    """Euler angles (XYZ) of rotations, (n, 3, 3) to (n, 3)."""
    cosine = np.hypot(turns[:, 0, 0], turns[:, 1, 0])
    plain = cosine > 1e-9
    x = np.where(plain, np.arctan2(turns[:, 2, 1], turns[:, 2, 2]), np.arctan2(-turns[:, 1, 2], turns[:, 1, 1]))
    z = np.where(plain, np.arctan2(turns[:, 1, 0], turns[:, 0, 0]), 0)
    return np.stack([x, np.arctan2(-turns[:, 2, 0], cosine), z], -1)


def told(states: np.ndarray, farthest: float) -> str:
    """The places that are not carried, or not as they should be, in words; empty if there are none."""
    lines, number = [], len(states)
    if far := int((states == TOO_FAR).sum()):
        lines.append(f"{far} of {number} are farther than {farthest:.3g} from the skin at rest, and stay as they are")
    if outside := int(((states == OUTSIDE) | (states == FOLDED)).sum()):
        lines.append(f"{outside} of {number} lie where the skin has no UVs, or folded ones, and follow the skin alone")
    return "; ".join(lines)
