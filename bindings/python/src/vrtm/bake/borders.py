"""The choice of --seams and --open-borders, unless the command line makes it.

The choice follows from the scene as a whole and from options that all tasks of a bake share, never from --frames or
--tiles: all tasks of a farm, and a bake that goes on where it stopped, choose the same.
"""

import dataclasses
from collections.abc import Callable, Iterator, Sequence

import numpy as np

import vrtm
from vrtm import borders
from vrtm.bake import image_file
from vrtm.bake.frames import Frame
from vrtm.bake.layer.write import looked_up as textures_of
from vrtm.bake.mesh_work import MeshWork
from vrtm.bake.neighbours import Neighbours
from vrtm.bake.part import Given
from vrtm.bake.scene import Scene, SceneError, Shape
from vrtm.bake.settings import AUTO, Borders, Settings
from vrtm.bake.units import Ruler, spread
from vrtm.bake.words import numbered

_CELLS = 512
"""Per side: a finer grid hardly ever tells more of which of two ways is better."""


def mesh(given: Given, scene: Scene, neighbours: Callable[[], Neighbours]) -> MeshWork:
    """A mesh, with the treatment of its borders chosen as far as the command line leaves it open. `neighbours`: gives
    those of the scene, which take time. Raises what MeshWork raises."""
    settings, shape = given.settings, given.shape

    def made(chosen: Borders) -> MeshWork:
        return MeshWork(given, chosen)

    looked_up: list[str] = []
    if AUTO in (settings.seams, settings.open_borders) and scene.is_usd:
        # Also where another task writes the layer.
        looked_up = textures_of(scene, shape, settings.layer_mode if settings.layer else "texture")
    copied = settings.textures or settings.normal_maps
    if not (copied or looked_up) or (settings.corner_uvs and not looked_up) or settings.options.texture_uv is not None:
        # Any texture may be looked up.
        return made(_chosen(settings, "shut", "fixed", "not all textures are known that are looked up"))
    lacking = [path for path in looked_up if not _is_dilated(path, settings.seam_reach)]
    why = f"{lacking[0]} is looked up, and is not dilated" if lacking else ""
    if not why:
        found = made(_beyond(settings, shape, looked_up, neighbours))
        why = _without_copy(found)
        if not why:
            return found
        found.close()
    found = made(_chosen(settings, "shut", "fixed", why))
    tiles = [tile for part in found.parts for tile in part.all_tiles]
    # Both are the same if no rigid texel is fixed.
    if settings.seams != AUTO or not any(tile.info.fixed for tile in tiles):
        return found
    if settings.only_layer or settings.dry_run:
        # Nothing is to be solved, and nothing that is told or written differs.
        found.borders = _chosen(settings, "shut", "fixed", f"{why}; if keep is better, a bake takes that")
        return found
    chosen = _kept_or_shut(given, scene, why)
    if chosen.seams == "shut":
        found.borders = chosen
        return found
    found.close()
    return made(chosen)


def _chosen(settings: Settings, seams: str, open_borders: str, why: str) -> Borders:
    """The treatment of borders, as far as the command line does not state it."""
    own = {"seams": seams, "open_borders": open_borders}
    given = {name: getattr(settings, name) for name in own if getattr(settings, name) != AUTO}
    return Borders(**(own | given), why="" if len(given) == len(own) else why)


def _is_dilated(path: str, reach: float) -> bool:
    told = image_file.told(path)
    return told.get("vrtm:kind") == "dilated" and float(told.get("vrtm:reach", 0)) >= reach


def _beyond(
    settings: Settings, shape: Shape, looked_up: Sequence[str], neighbours: Callable[[], Neighbours]
) -> Borders:
    """The choice where textures show the surface beyond the borders."""
    why = f"all textures are {'copies or dilated' if looked_up else 'copies'}"
    if settings.subsets:
        return _chosen(settings, "continue", "fixed", f"{why}, and subsets meet")
    if settings.open_borders == AUTO:
        places, vertices = borders.places(shape.rest), shape.indices
        # Doubled vertices, unless they are welded.
        doubled = borders.shared([places])
        if settings.weld == "position":
            _, first, of = np.unique(places, return_index=True, return_inverse=True)
            doubled, vertices = doubled[:0], first[of.reshape(-1)][vertices]
        border = borders.open_border(vertices, shape.face_counts, shape.textured)
        if np.isin(places[border], doubled).any() or neighbours().touch(shape, border):
            return _chosen(settings, "continue", "fixed", f"{why}, and other vertices are where the mesh ends")
    return _chosen(settings, "continue", "slide", why)


def _without_copy(mesh: MeshWork) -> str:
    """A sentence about a texture of a mesh without all of its copies; empty if each has them."""
    for part in mesh.parts:
        for copy, paths in part.textures:
            lacking = [udim for udim in part.all_udims if udim not in paths]
            if lacking:
                return f"{copy.pattern} has no file of {numbered('tile', lacking)}"
    return ""


def _kept_or_shut(given: Given, scene: Scene, why: str) -> Borders:
    """The better one of `keep` and `shut` in the most deformed one of a few frames of the scene. It is found on the
    CPU, where all machines find the same. `why`: why seams do not go on."""
    settings, shape = given.settings, given.shape
    ruler, strain = Ruler(shape), dict[Frame, float]()
    for frame in spread(scene.frames):
        try:
            strain[frame] = ruler.strain(scene.positions(shape, frame))
        except SceneError:
            # It is said of the frames that are baked.
            continue
    if not strain:
        return _chosen(settings, "shut", "fixed", why)
    frame = max(strain, key=lambda frame: strain[frame])
    positions = scene.positions(shape, frame)
    # Tiles that are not to be baked count, too.
    everything = dataclasses.replace(settings, tiles=None)
    with vrtm.Device("cpu", threads=given.device.info.threads) as device:
        on_cpu = dataclasses.replace(given, settings=everything, device=device)
        mesh = MeshWork(on_cpu, _chosen(settings, "shut", "fixed", ""))
        try:
            seams, told = borders.kept_or_shut(lambda seams: _measured(mesh, seams, frame, positions))
        except SceneError:
            return _chosen(settings, "shut", "fixed", why)
        finally:
            mesh.close()
    return _chosen(settings, seams, "fixed", f"{why}; in frame {frame} {told}")


def _measured(mesh: MeshWork, seams: str, frame: Frame, positions: np.ndarray) -> Iterator[vrtm.TileReport]:
    for part in mesh.parts:
        for tile in part.all_tiles:
            # Settings of one layer hold for all layers of its tile.
            if tile.layer == 0:
                now = tile.settings
                width, height = (min(cells, _CELLS) for cells in tile.grid)
                tile.set_settings(now, seams=seams, grid_width=width, grid_height=height)
        part.solve(frame, positions, part.tiles, True, False, False, lambda: None)
        yield from (tile.report() for tile in part.all_tiles)
