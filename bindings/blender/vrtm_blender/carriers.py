"""Carriers of the things that an object carries, and the connected parts of detail meshes among them. None of this
touches Blender's data: it takes arrays, on any thread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from mathutils.bvhtree import BVHTree

from . import session

if TYPE_CHECKING:
    import vrtm

    from .geometry import Topology

# States of a carrier's points: on a chart, outside of all, in folded UVs, and too far from the surface.
BOUND, OUTSIDE, FOLDED, TOO_FAR = range(4)


@dataclass(eq=False)
class Thing:
    """One carried object."""

    uid: int
    name: str
    places: np.ndarray  # (places, 3) float64, in the skin's space: where they are at rest, as far as it is known
    to_skin: np.ndarray  # (4, 4) float64 from its own space to the skin's
    is_whole: bool  # carried as a whole
    farthest: float
    fit: str
    skirt: float
    # The connected part of each place, (places,): each part moves as one body. None: each place moves by itself.
    parts: np.ndarray | None = None
    # The same places as they are seen in a pose, until those at rest are found; True if they are not on the skin there.
    seen: np.ndarray | None = None
    lost: bool = False
    # From the places that are bound to the places, (places, 3): with it, what was seen is met to the last bit.
    off: np.ndarray | None = None
    # The turns of points from rest to where their data has them, (places, 3, 3).
    turned: np.ndarray | None = None
    # What was found, for Blender's data: as a whole (4, 4), else (places, 4, 4) from its own space to its own at rest.
    # The last row, which such transforms do not need, has `off`, in the same space.
    rest: np.ndarray | None = None

    @property
    def way(self) -> tuple[float, str, float]:
        # A skirt bends what it blends.
        return self.farthest, self.fit, self.skirt if self.parts is None else 0.0

    @property
    def bound(self) -> np.ndarray:
        return self.places if self.off is None else self.places - self.off

    def settle(self, off: np.ndarray, turns: np.ndarray) -> None:
        """Takes the present places as those at rest, which are carried as far as `off` from what is seen, (places, 3),
        with these turns, (places, 3, 3)."""
        back, to_own = np.swapaxes(turns, 1, 2), np.linalg.inv(self.to_skin)
        self.off = np.einsum("nij,nj->ni", back, off)
        self.places = self.places + self.off
        if self.is_whole:
            self.to_skin[:3, :3], self.to_skin[:3, 3] = back[0] @ self.to_skin[:3, :3], self.places[0]
            self.rest = self.to_skin.copy()
            self.rest[3, :3] = self.off[0]
        else:
            axes = rotation_of(self.to_skin)
            self.rest = np.tile(np.eye(4), (len(self.places), 1, 1))
            self.rest[:, :3, :3] = axes.T @ back @ axes
            at_rest, now = (of @ to_own[:3, :3].T + to_own[:3, 3] for of in (self.places, self.seen))
            self.rest[:, :3, 3] = at_rest - np.einsum("nij,nj->ni", self.rest[:, :3, :3], now)
            self.rest[:, 3, :3] = self.off @ to_own[:3, :3].T
            self.turned = turns
        self.seen = None


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
    # Else, in its own space, (places, 3) float64: places, and Euler angles (XYZ) from where its data has them.
    places: np.ndarray | None = None
    turns: np.ndarray | None = None
    rest: np.ndarray | None = None  # as the Thing's, if it was found just now


class Carriers:
    """Carriers of an asset: one for all that is carried in the same way. `rest` has the skin's vertices, (vertices, 3).
    Raises vrtm.Error."""

    def __init__(self, asset: vrtm.Asset, given: CarriedInput, topology: Topology, rest: np.ndarray) -> None:
        self._asset, self._topology, self._rest = asset, topology, rest
        self.things, self.scale = given.things, given.scale
        # Lengths that are none.
        self._enough = 1e-5 * np.linalg.norm(np.ptp(rest, axis=0))
        self._groups: list[tuple[vrtm.Carrier, list[Thing]]] = []
        self._bind()

    def _bind(self) -> None:
        """Binds all things where they are at rest."""
        self.close()
        # By uid: the places that are bound, (roots, 3): all of them, or one for each part.
        self._roots = {thing.uid: thing.bound for thing in self.things}
        for thing in [thing for thing in self.things if thing.parts is not None]:
            of = session.library("vrtm.bake.carry_parts")
            skin = of.Nearest(self._rest[self._topology.corner_vertices[self._topology.triangles]].astype(np.float64))
            self._roots[thing.uid] = of.feet(thing.bound, thing.bound, thing.parts, skin)
        # By uid: how each place is bound, (places,) int32.
        self.states: dict[int, np.ndarray] = {}
        self._groups = []
        for way in dict.fromkeys(thing.way for thing in self.things):
            farthest, fit, skirt = way
            things = [thing for thing in self.things if thing.way == way]
            roots = np.concatenate([self._roots[thing.uid] for thing in things])
            carrier = self._asset.carrier(positions=roots, farthest=farthest, fit=fit, skirt=skirt)
            self._groups.append((carrier, things))
            for thing, states in self._split(things, carrier.states()):
                states = states if thing.parts is None else states[thing.parts]
                self.states[thing.uid] = np.full_like(states, TOO_FAR) if thing.lost else states

    def settle(self, pose: np.ndarray, solve: Callable[[], object]) -> None:
        """Finds the places at rest of things that are known as they are seen in this pose, which was solved last.
        `solve` solves it again, for new carriers."""
        seen = [thing for thing in self.things if thing.seen is not None]
        if not seen:
            return
        for attempt in range(4):
            carried = self._carried()
            off = [thing.seen - carried[thing.uid][0] for thing in seen]
            # What is far from the skin at rest may lie on it as it is seen.
            far = attempt == 0 and any(TOO_FAR in self.states[thing.uid] for thing in seen)
            if attempt == 3 or (not far and all(np.abs(way).max() < self._enough for way in off)):
                break
            if attempt == 0:
                self._guess(seen, pose)
                seen = [thing for thing in seen if not thing.lost]
                if not seen:
                    return
            else:
                # Back by the turn with which the place was carried.
                for thing, way in zip(seen, off):
                    way[self.states[thing.uid] == TOO_FAR] = 0
                    thing.places = thing.places + np.einsum("nji,nj->ni", carried[thing.uid][1], way)
            self._bind()
            solve()
        for thing, way in zip(seen, off):
            far = self.states[thing.uid] == TOO_FAR
            way[far], turns = 0, np.where(far[:, None, None], np.eye(3), carried[thing.uid][1])
            thing.settle(way, turns)

    def _guess(self, things: list[Thing], pose: np.ndarray) -> None:
        """Puts places that are seen in a pose to where the skin has the same texture at rest, or a neighbouring one."""
        of, seen = self._topology, np.concatenate([thing.seen for thing in things])
        corners, faces = of.triangles, np.maximum(of.face_counts.astype(np.int64) - 2, 0)
        vertices, layers = of.corner_vertices[corners], 100.0 * np.repeat(self._asset.face_layers(), faces)
        index, weights, height, far = nearest(pose[vertices], seen)
        shown = (weights[..., None] * self._asset.corner_uvs()[corners[index]]).sum(1)
        charts = np.concatenate([of.uvs[corners], np.broadcast_to(layers[:, None, None], (len(corners), 3, 1))], -1)
        index, weights, _, _ = nearest(charts, np.column_stack([shown, layers[index]]))
        rest = self._rest[vertices[index]]
        places = (weights[..., None] * rest).sum(1) + height[:, None] * normals(rest)
        for thing in things:
            number = len(thing.places)
            away = far[:number] > thing.farthest
            thing.lost, thing.places = bool(away.all()), np.where(away[:, None], thing.seen, places[:number])
            if thing.lost:
                self.states[thing.uid] = np.full(number, TOO_FAR)
            far, places = far[number:], places[number:]

    def _carried(self) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Of all things, by uid: the places in the pose that was solved last, and their turns, (places, 3, 3)."""
        found = {}
        for carrier, things in self._groups:
            carried = carrier.fetch("positions", "matrices", dtype=np.float64)
            positions, matrices = (self._split(things, of) for of in (carried.positions, carried.matrices))
            for (thing, places), (_, turns) in zip(positions, matrices):
                of = slice(None) if thing.parts is None else thing.parts
                turns, offsets = turns[of], thing.places - self._roots[thing.uid][of]
                found[thing.uid] = places[of] + np.einsum("nij,nj->ni", turns, offsets), turns
        return found

    def fetch(self) -> dict[int, Moved]:
        """All things in the pose that was solved last, by uid. Things that are too far stay as they are, and those
        whose places at rest are not known yet are left out."""
        carried, found = self._carried(), {}
        for thing in [thing for thing in self.things if thing.seen is None]:
            (places, turns), far = carried[thing.uid], self.states[thing.uid] == TOO_FAR
            places = np.where(far[:, None], thing.places, places)
            found[thing.uid] = _moved(thing, places, np.where(far[:, None, None], np.eye(3), turns))
        return found

    def figures(self) -> list[tuple[str, str]]:
        """Labels and values of the last fetch, for the panel."""
        if not self._groups:
            return []
        rim = max(carrier.info.rim for carrier, _ in self._groups)
        number = sum(int((states != TOO_FAR).sum()) for states in self.states.values())
        return [("Carried", str(number)), ("Rims lift off", f"{self.scale * rim if rim > self._enough else 0:.3g}")]

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
        return Moved(matrix, rest=thing.rest)
    if thing.turned is not None:
        turns = turns @ np.swapaxes(thing.turned, 1, 2)
    axes = rotation_of(thing.to_skin)
    own = (places - thing.to_skin[:3, 3]) @ np.linalg.inv(linear).T
    return Moved(None, own, eulers(axes.T @ turns @ axes), thing.rest)


def rotation_of(matrix: np.ndarray) -> np.ndarray:
    """The rotation alone of a transform, without the scale, (3, 3)."""
    u, _, v = np.linalg.svd(matrix[:3, :3])
    return u @ v


def nearest(triangles: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of each point, (points, 3): the nearest one of triangles, (triangles, 3, 3), the weights of its corners there,
    (points, 3), and the point's height over it and its distance."""
    numbers = np.arange(3 * len(triangles)).reshape(-1, 3)
    tree = BVHTree.FromPolygons(triangles.reshape(-1, 3).tolist(), numbers.tolist())
    hits = [tree.find_nearest(point) for point in points.tolist()]
    index, at = np.array([hit[2] for hit in hits]), np.array([hit[0][:] for hit in hits])
    sides = triangles[index] - at[:, None]
    areas = np.linalg.norm(np.cross(np.roll(sides, -1, 1), np.roll(sides, -2, 1)), axis=-1)
    areas += 1e-30
    height = ((points - at) * normals(triangles[index])).sum(-1)
    return index, areas / areas.sum(1, keepdims=True), height, np.linalg.norm(points - at, axis=-1)


def normals(triangles: np.ndarray) -> np.ndarray:
    """(triangles, 3)"""
    found = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]).astype(np.float64)
    return found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-30)


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
        lines.append(f"{far} of {number} are farther than {farthest:.3g} from the skin, and stay as they are")
    if outside := int(((states == OUTSIDE) | (states == FOLDED)).sum()):
        lines.append(f"{outside} of {number} lie where the skin has no UVs, or folded ones, and follow the skin alone")
    return "; ".join(lines)
