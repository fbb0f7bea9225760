"""From an object's settings and geometry to an asset that is ready, and from a pose to its result."""

from __future__ import annotations

import bpy
import numpy as np

from . import geometry, maps, session
from .messages import Problem
from .session import Request, State


def prepare(obj: bpy.types.Object, state: State) -> None:
    """Makes or mends the object's asset, as far as what it depends on has changed. Raises a Problem or vrtm.Error."""
    if obj.mode == "EDIT":
        raise Problem(f"{obj.name} is in Edit Mode: results are computed when you leave it")
    settings = obj.vrtm
    if settings.rigidity_source == "NONE":
        raise Problem(f"{obj.name}: choose where the rigidity is painted")
    if state.asset is None or geometry.counts(obj.data) != state.counts:
        state.mesh_changed = True
    if state.mesh_changed:
        _prepare_mesh(obj, state)
    if state.maps_changed:
        _prepare_maps(obj, state)


def _prepare_mesh(obj: bpy.types.Object, state: State) -> None:
    settings = obj.vrtm
    topology, rest = geometry.topology(obj), geometry.rest_positions(obj)
    stamp = (topology.stamp, geometry.stamp_of(rest), settings.device)
    if state.asset is None or state.stamps.get("mesh") != stamp:
        state.end_asset()
        vrtm = session.library()
        state.asset = vrtm.Asset(
            session.device(settings.device),
            rest,
            topology.corner_vertices,
            face_counts=topology.face_counts,
            uvs=topology.uvs,
        )
        state.stamps["mesh"] = stamp
        state.maps_changed = True
    state.counts = geometry.counts(obj.data)
    state.mesh_changed = False


def _prepare_maps(obj: bpy.types.Object, state: State) -> None:
    rigidity, mask = maps.read_map(obj, "rigidity"), maps.read_map(obj, "mask")
    settings = settings_of(obj)
    for which, new in (("rigidity", rigidity), ("mask", mask), ("settings", settings)):
        stamp = tuple(new.values()) if which == "settings" else (new.stamp, sorted(udim or 0 for udim in new.tiles))
        if state.stamps.get(which) == stamp:
            continue
        # An asset belongs to its job until that is over.
        state.end_job()
        # What is set first must not stay if what follows fails.
        state.stamps.pop(which, None)
        if which == "settings":
            for tile in state.asset.tiles:
                tile.set_settings(**new)
        elif which == "rigidity":
            _set_rigidity(state, new)
        else:
            _set_mask(state, new)
        state.stamps[which] = stamp
    state.maps_changed = False


def settings_of(obj: bpy.types.Object) -> dict[str, object]:
    """What is set of all tiles."""
    settings = obj.vrtm
    borders = {name: getattr(settings, name) for name in ("seams", "open_borders", "seam_reach")}
    return {"grid_width": settings.grid, "grid_height": settings.grid} | borders


def _set_mask(state: State, new: maps.Map) -> None:
    state.asset.set_vertex_mask(new.vertices)
    if new.vertices is None:
        for tile in state.asset.tiles:
            image = new.of(tile.udim)
            tile.set_mask(image, **_origin(image))


def _set_rigidity(state: State, new: maps.Map) -> None:
    # Kept again at the end: after a failure all of it is set again.
    before, state.painted = state.painted, {}
    if new.vertices is not None or not before:
        state.asset.set_vertex_rigidity(new.vertices)
    if new.vertices is not None:
        return
    for tile in state.asset.tiles:
        image, old = new.of(tile.udim), before.get(tile.udim)
        if image is None or old is None or image.shape != old.shape:
            tile.set_rigidity(image, **_origin(image))
            continue
        # A stroke of a brush: only what has changed is prepared again.
        changed = image != old
        rows, columns = np.flatnonzero(changed.any(1)), np.flatnonzero(changed.any(0))
        if len(rows):
            x, y, width, height = columns[0], rows[0], np.ptp(columns) + 1, np.ptp(rows) + 1
            tile.update_rigidity(image, int(x), int(y), int(width), int(height), origin=maps.ORIGIN)
    state.painted = {tile.udim: image for tile in state.asset.tiles if (image := new.of(tile.udim)) is not None}


def _origin(image: np.ndarray | None) -> dict[str, str]:
    return {} if image is None else {"origin": maps.ORIGIN}


def options_of(obj: bpy.types.Object) -> dict[str, object]:
    """How the library solves for this object."""
    return {"quality": obj.vrtm.quality, "measure": obj.vrtm.measure}


def request(obj: bpy.types.Object, state: State, depsgraph: bpy.types.Depsgraph) -> Request:
    """The object's pose now. Call prepare() before."""
    positions, options = geometry.pose(obj, depsgraph), options_of(obj)
    settings = obj.vrtm
    outputs = (settings.map_size, settings.write_image, settings.write_uvs)
    inputs = repr((sorted(options.items()), outputs, sorted(state.stamps.items()))).encode()
    return Request(positions, options, geometry.stamp_of(positions) + inputs, obj.name, *outputs)


def run(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> State:
    """Solves for the object's pose and writes the results, before it returns. Raises a Problem or vrtm.Error."""
    from . import results

    state = session.state_of(obj)
    state.end_job()
    state.wanted = False
    prepare(obj, state)
    wanted = request(obj, state, depsgraph)
    if wanted.stamp == state.shown and results.are_there(obj):
        return state
    state.asset.solve(wanted.positions, **wanted.options)
    results.publish(obj, state, wanted, results.fetch(state.asset, wanted))
    return state
