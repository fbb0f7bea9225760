"""Other programs: each takes a case and returns new UVs per UV vertex, in cells, with the CPU seconds it took.

Both minimise the distortion of whole charts against the deformed mesh. They use neither the rigidity nor the rest pose.
SLIM starts from the original UVs, Blender from a map of its own.
"""

import time

import igl
import numpy as np
from case import Case
from geometry import areas


def slim(case: Case, iterations: int) -> tuple[np.ndarray, float]:
    """libigl's SLIM with the symmetric Dirichlet energy, chart by chart, borders held by its soft constraint."""
    uv, seconds = case.uv.copy(), 0.0
    for chart in np.unique(case.chart[case.faces[:, 0]]):
        vertices, faces = np.unique(case.faces[case.chart[case.faces[:, 0]] == chart], return_inverse=True)
        pinned = np.flatnonzero(np.isin(vertices, case.border)).astype(np.int32)
        if len(pinned) < len(vertices):
            inside, took = slim_of_chart(case.pose[vertices], faces.reshape(-1, 3), uv[vertices], pinned, iterations)
            # Where SLIM fails it leaves numbers that are not finite; the original UVs then count as its result.
            if np.isfinite(inside).all():
                uv[vertices] = inside
            seconds += took
    return uv, seconds


def slim_of_chart(positions, faces, uv, pinned, iterations: int) -> tuple[np.ndarray, float]:
    signed = areas(uv, faces)
    a, b, c = (positions[faces[:, k]] for k in range(3))
    surface = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    # The energy compares sizes: the surface is scaled to the chart's own area. It also requires triangles that face up.
    positions = positions * np.sqrt(np.abs(signed).sum() / surface.sum())
    if signed.sum() < 0:
        faces = faces[:, ::-1]
    start = time.process_time()
    data = igl.slim_precompute(
        np.asfortranarray(positions),
        np.asfortranarray(faces.astype(np.int32)),
        np.asfortranarray(uv),
        igl.MappingEnergyType.SYMMETRIC_DIRICHLET,
        pinned,
        np.asfortranarray(uv[pinned]),
        1e5,
    )
    inside = igl.slim_solve(data, iterations)
    return np.array(inside)[:, :2], time.process_time() - start


def blender(case: Case, iterations: int) -> tuple[np.ndarray, float]:
    """Blender's unwrap of the deformed mesh, method "minimum stretch", chart borders pinned."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("case")
    mesh.from_pydata(case.pose.tolist(), [], case.faces.tolist())
    # Blender may drop faces that it considers invalid; then its corners do not match ours.
    if len(mesh.polygons) != len(case.faces):
        raise RuntimeError("Blender dropped faces")
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    layer = mesh.uv_layers.new(name="uv")
    layer.uv.foreach_set("vector", (case.uv[corners] / case.grid).astype(np.float32).ravel())
    pins = mesh.attributes.new(f".pn.{layer.name}", "BOOLEAN", "CORNER")
    pins.data.foreach_set("value", np.isin(corners, case.border))
    thing = bpy.data.objects.new("case", mesh)
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.select_all(action="SELECT")
    start = time.process_time()
    bpy.ops.uv.unwrap(
        method="MINIMUM_STRETCH", fill_holes=False, correct_aspect=False, margin=0.0, iterations=iterations
    )
    seconds = time.process_time() - start
    bpy.ops.object.mode_set(mode="OBJECT")
    flat = np.empty(2 * len(mesh.loops), np.float32)
    mesh.uv_layers["uv"].uv.foreach_get("vector", flat)
    uv = case.uv.copy()
    uv[corners] = flat.reshape(-1, 2).astype(float) * case.grid
    return uv, seconds
