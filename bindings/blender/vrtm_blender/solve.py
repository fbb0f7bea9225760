"""From an object's settings and geometry to a job's inputs, and from a pose to its result."""

from __future__ import annotations

import dataclasses

import bpy

from . import borders, carry, geometry, layers, maps, nodes, results, session, states
from .messages import Problem
from .outcome import Request
from .prepared import MapsInput, MeshInput
from .states import State
from .work import Work


def read(obj: bpy.types.Object, state: State) -> None:
    """Reads the changed inputs of the object's asset into the state. Raises a Problem."""
    if obj.mode == "EDIT":
        raise Problem(f"{obj.name} is in Edit Mode: results are computed when you leave it")
    if not obj.vrtm.is_followed:
        raise Problem(f"{obj.name}: choose where the rigidity is painted")
    if geometry.counts(obj.data) != state.counts:
        state.mesh_changed = True
    if state.mesh_changed:
        _read_mesh(obj, state)
    if state.maps_changed:
        _read_maps(obj, state)
    if state.carried_changed:
        state.inputs.carried = carry.read(obj)
        state.stamps["carried"] = state.inputs.carried.stamp
        state.carried_changed = False


def _read_mesh(obj: bpy.types.Object, state: State) -> None:
    device, max_layers = obj.vrtm.device, layers.MOST if obj.vrtm.overlaps == "each" else 0
    topology, rest = geometry.topology(obj), geometry.rest_positions(obj)
    stamp = (topology.stamp, geometry.stamp_of(rest), device, max_layers, obj.vrtm.weld)
    if state.stamps.get("mesh") != stamp:
        # Maps are set for a mesh, and carriers made for it: all of them again.
        state.maps_changed = state.carried_changed = True
    state.inputs.mesh = MeshInput(topology, rest, device, max_layers, obj.vrtm.weld, stamp)
    state.stamps["mesh"] = stamp
    state.counts = geometry.counts(obj.data)
    state.mesh_changed = False


def _read_maps(obj: bpy.types.Object, state: State) -> None:
    rigidity, mask, settings = maps.read_map(obj, "rigidity"), maps.read_map(obj, "mask"), settings_of(obj)
    stamps = {
        "rigidity": (rigidity.stamp, sorted(udim or 0 for udim in rigidity.tiles)),
        "mask": (mask.stamp, sorted(udim or 0 for udim in mask.tiles)),
        "settings": tuple(settings.values()),
    }
    state.inputs.maps = MapsInput(rigidity, mask, settings, stamps)
    state.stamps |= stamps
    state.maps_changed = False


def level_of(obj: bpy.types.Object) -> tuple[str, int, int]:
    """Quality, grid and map size: the viewport's, or those of renders and bakes."""
    kind = "render_" if session.rendering or session.baking else ""
    return tuple(getattr(obj.vrtm, kind + name) for name in ("quality", "grid", "map_size"))


def settings_of(obj: bpy.types.Object) -> dict[str, object]:
    """The settings of all tiles."""
    settings, found = obj.vrtm, borders.chosen(obj)
    ways = {"seams": found.seams, "open_borders": found.open_borders, "seam_reach": settings.seam_reach}
    # Islands that lie over themselves, and those beyond the last layer, stay as they are.
    overlap = "first_face" if settings.overlaps == "first_face" else "fixed"
    grid, turns = level_of(obj)[1], settings.keep_direction
    if turns and (found.seams == "continue" or found.open_borders == "slide"):
        raise Problem(f"{obj.name}: Keep Direction does not go with seams that continue: set it to 0, or Seams to Auto")
    # Calm 1 and -1 are the ends of what is of use, 4 times the library's smoothness and a quarter of it.
    knobs = {"harm": settings.harm, "smoothness": 0.02 * 4**settings.calm, "room": settings.room}
    knobs["orientation_density"] = turns
    return {"grid_width": grid, "grid_height": grid, "overlap": overlap} | ways | knobs


def options_of(obj: bpy.types.Object) -> dict[str, object]:
    """The options of the library's solves for this object."""
    return {"quality": level_of(obj)[0], "measure": obj.vrtm.measure, "scale": obj.vrtm.scale}


def prepare(obj: bpy.types.Object, state: State) -> None:
    """Makes or mends the object's asset before it returns. Raises a Problem or vrtm.Error."""
    state.end_job()
    read(obj, state)
    inputs = state.inputs.take()
    try:
        state.prepared.apply(inputs)
    except BaseException:
        state.inputs.give_back(inputs)
        raise


def find_seams(obj: bpy.types.Object, state: State, depsgraph: bpy.types.Depsgraph) -> None:
    """Chooses the better one of Keep and Shut in the object's pose, if Auto leaves both. Raises a Problem or
    vrtm.Error."""
    settings = obj.vrtm
    if settings.seams != borders.AUTO or not settings.is_set_up or borders.chosen(obj).seams == "continue":
        return
    prepare(obj, state)
    prepared, positions = state.prepared, geometry.pose(obj, depsgraph)
    if any(tile.info.fixed for tile in prepared.asset.tiles):
        options, choose = options_of(obj) | {"measure": True}, session.library("vrtm.borders").kept_or_shut
        found, told = choose(lambda seams: prepared.measured(seams, positions, options))
        told = f"at frame {depsgraph.scene.frame_current} {told}"
        # The tiles have other settings now.
        state.maps_changed = True
    else:
        found, told = "shut", "nothing rigid is on a border"
    settings.seams_found, settings.seams_why = found, told


def request(obj: bpy.types.Object, state: State, depsgraph: bpy.types.Depsgraph) -> Request:
    """The object's pose now. Call read() before."""
    positions, options = geometry.pose(obj, depsgraph), options_of(obj)
    settings = obj.vrtm
    # Without a rigidity there is strain to be shown, and nothing to be redirected.
    written = (obj.vrtm.is_set_up and results.is_written(obj, name) for name in results.OUTPUTS)
    strain = "NONE" if geometry.is_linked(obj) else settings.strain
    outputs = (level_of(obj)[2], *written, strain, settings.strain_of)
    inputs = repr((sorted(options.items()), outputs, sorted(state.stamps.items()))).encode()
    stamp = geometry.stamp_of(positions) + inputs
    frame, by_uv_map = depsgraph.scene.frame_current, nodes.shows_uv_map(obj)
    return Request(positions, options, stamp, obj.name, *outputs, frame, by_uv_map)


def draft(request: Request) -> Request:
    """The same as a draft."""
    options = request.options | {"quality": "draft", "measure": False}
    return dataclasses.replace(request, options=options, stamp=request.stamp + b"draft", is_draft=True)


def run(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> State:
    """Solves for the object's pose and writes the results, before it returns. Raises a Problem or vrtm.Error."""
    state = states.state_of(obj)
    state.end_job()
    state.wanted = False
    read(obj, state)
    wanted = request(obj, state, depsgraph)
    if results.is_shown(obj, state, wanted) and not state.rewrite:
        results.still_right(state, wanted)
        return state
    state.job = Work(state.prepared, state.inputs.take(), wanted)
    try:
        outcome = state.job.result()
    finally:
        state.take_job()
    results.publish(obj, state, wanted, outcome)
    return state
