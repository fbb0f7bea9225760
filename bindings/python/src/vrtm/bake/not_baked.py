"""Parts of an open scene that are left out, and why: by options, maps and the range, or since nothing is gained."""

from collections.abc import Collection, Iterator, Sequence

from vrtm.bake import frames, gain
from vrtm.bake.failure import INPUT, Failure
from vrtm.bake.frames import Frame
from vrtm.bake.left_out import LeftOut
from vrtm.bake.mesh_work import MeshWork
from vrtm.bake.settings import Settings


def of_frames(settings: Settings, there: Sequence[Frame], missing: tuple[Frame, ...]) -> Iterator[LeftOut]:
    """Frames of the scene that --frames leaves out, and frames that it names beside them."""
    if settings.frames is not None:
        # Not by their numbers: nobody asked for these.
        known = there if isinstance(there, range) else set(there)
        asked = sum(frame in known for frame in settings.frames)
        if asked < len(there):
            yield LeftOut(f"all but {asked} of {len(there)} frames: not in --frames", meant=True)
    if missing:
        yield LeftOut(f"the scene has {frames.text(there)}", frames=missing)


def of_meshes(settings: Settings, meshes: Collection[MeshWork]) -> Iterator[LeftOut]:
    """Tiles that --tiles and maps leave out. Raises Failure if no tile is left."""
    for mesh in meshes:
        yield from mesh.left_out
        without = tuple(udim for udim in mesh.all_udims if udim not in (settings.tiles or mesh.all_udims))
        if without:
            yield LeftOut("not in --tiles", mesh.shape.path, tiles=without, meant=True)
    present = {udim for mesh in meshes for udim in mesh.all_udims}
    if settings.tiles is not None and not present & set(settings.tiles):
        there = ", ".join(map(str, sorted(present)))
        raise Failure(INPUT, f"--tiles: the scene has none of these; it has {there}")
    missing = sorted(set(settings.tiles or ()) - present)
    if missing:
        yield LeftOut("no mesh has UVs there, which --tiles names", tiles=tuple(missing))
    what = "no map of --rigidity" if settings.rigidity else "no values of --rigidity-primvar"
    for part in (part for mesh in meshes for part in mesh.parts):
        udims = part.without("rigidity")
        if udims:
            name = part.shape.name
            other = "<mesh>" in (settings.rigidity or "") and name != part.shape.path.rsplit("/", 1)[-1]
            called = f" (<mesh> stands for {name})" if other else ""
            yield LeftOut(f"{what}{called}: nothing keeps its shape there", part.where, tiles=tuple(udims))


def without_gain(mesh: MeshWork, idle: dict[gain.Group, str]) -> Iterator[LeftOut]:
    """The list's entries of what gains nothing. A part without any map has one that says so."""
    if not mesh.parts[0].subset and len(set(idle.values())) == 1 and len(idle) == len(gain.groups(mesh.parts)):
        (why,) = set(idle.values())
        if why == gain.RIGIDLY or not mesh.parts[0].without("rigidity"):
            yield LeftOut(why, mesh.shape.path, meant=True)
        return
    for part in mesh.parts:
        for why in (gain.RIGIDLY, gain.NOTHING):
            layers = tuple(layer for (subset, layer), reason in idle.items() if (subset, reason) == (part.subset, why))
            every = len(layers) == len({tile.layer for tile in part.all_tiles})
            if layers and not (every and why == gain.NOTHING and part.without("rigidity")):
                yield LeftOut(why, part.where, layers=() if every else layers, meant=True)
