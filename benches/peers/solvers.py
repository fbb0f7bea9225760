"""The peers: each takes a case and gives new UVs per UV vertex, in cells, with the seconds of the solver call alone.

Both minimise the distortion of a whole chart against the deformed mesh. They know neither what is rigid nor the rest pose.
"""

import time

import igl
import numpy as np

from case import Case, areas


def slim(case: Case, iterations: int) -> tuple[np.ndarray, float]:
    """libigl's SLIM with the symmetric Dirichlet energy, borders held by its soft constraint."""
    faces = case.faces.copy()
    signed = areas(case.uv, faces)
    positions = case.pose.copy()
    normal = np.cross(positions[faces[:, 1]] - positions[faces[:, 0]], positions[faces[:, 2]] - positions[faces[:, 0]])
    surface = 0.5 * np.linalg.norm(normal, axis=1)
    for chart in np.unique(case.chart[faces[:, 0]]):
        inside = case.chart[faces[:, 0]] == chart
        # The energy compares sizes: the surface gets the chart's own area. It also wants triangles that face up.
        positions[case.chart == chart] *= np.sqrt(np.abs(signed[inside]).sum() / surface[inside].sum())
        if signed[inside].sum() < 0:
            faces[inside] = faces[inside][:, ::-1]
    pinned = case.border.astype(np.int32)
    start = time.perf_counter()
    data = igl.slim_precompute(
        np.asfortranarray(positions),
        np.asfortranarray(faces.astype(np.int32)),
        np.asfortranarray(case.uv),
        igl.MappingEnergyType.SYMMETRIC_DIRICHLET,
        pinned,
        np.asfortranarray(case.uv[pinned]),
        1e5,
    )
    uv = igl.slim_solve(data, iterations)
    return np.array(uv)[:, :2], time.perf_counter() - start


def blender(case: Case, iterations: int) -> tuple[np.ndarray, float]:
    """Blender's unwrap of the deformed mesh, method "minimum stretch", chart borders pinned."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("case")
    mesh.from_pydata(case.pose.tolist(), [], case.faces.tolist())
    # Blender may leave out what it takes for bad faces; then its corners are not ours.
    if len(mesh.polygons) != len(case.faces):
        raise RuntimeError("Blender dropped faces")
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    layer = mesh.uv_layers.new(name="uv")
    layer.uv.foreach_set("vector", (case.uv[corners] / case.grid).astype(np.float32).ravel())
    on_border = np.isin(corners, case.border)
    for corner in np.flatnonzero(on_border):
        layer.pin[corner].value = True
    thing = bpy.data.objects.new("case", mesh)
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    start = time.perf_counter()
    bpy.ops.uv.unwrap(
        method="MINIMUM_STRETCH", fill_holes=False, correct_aspect=False, margin=0.0, iterations=iterations
    )
    seconds = time.perf_counter() - start
    bpy.ops.object.mode_set(mode="OBJECT")
    flat = np.empty(2 * len(mesh.loops), np.float32)
    mesh.uv_layers["uv"].uv.foreach_get("vector", flat)
    uv = case.uv.copy()
    uv[corners] = flat.reshape(-1, 2).astype(float) * case.grid
    return uv, seconds
