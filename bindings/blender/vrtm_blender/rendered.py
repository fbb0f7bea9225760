"""The poses that renders have, with their modifiers, levels and simplification. Scripts cannot evaluate a scene so; a
render engine is given such an evaluation. This one has a bake of a triangle asked of it, which leaves the last render's
picture as it is."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

import bpy
import numpy as np

from . import geometry, session


class VRTM_RE_evaluation(bpy.types.RenderEngine):
    bl_idname, bl_label = "VRTM_EVALUATION", "vrtm evaluation"
    work: Callable[[bpy.types.Depsgraph], None] | None = None

    def bake(self, depsgraph: bpy.types.Depsgraph, obj, kind, passes, width, height) -> None:
        VRTM_RE_evaluation.work(depsgraph)


def bake(scene: bpy.types.Scene, layer: bpy.types.ViewLayer, obj: bpy.types.Object) -> None:
    """Bakes the emission of an object to its active colour attribute, by the scene's engine."""
    given = {"object": obj, "active_object": obj, "selected_objects": [obj]}
    with bpy.context.temp_override(scene=scene, view_layer=layer, **given):
        bpy.ops.object.bake(type="EMIT", target="VERTEX_COLORS")


@contextlib.contextmanager
def evaluation(scene: bpy.types.Scene) -> Iterator[Callable[[list[bpy.types.Object]], list[np.ndarray]]]:
    """A function to the poses of objects at the present frame, which raises a Problem. Blender lists the engine until
    the end of the block."""
    bpy.utils.register_class(VRTM_RE_evaluation)
    mesh = bpy.data.meshes.new(VRTM_RE_evaluation.bl_label)
    name = mesh.name
    mesh.from_pydata([(0, 0, 0), (1e-6, 0, 0), (0, 1e-6, 0)], [], [(0, 1, 2)])
    mesh.color_attributes.new(name, "FLOAT_COLOR", "CORNER")
    triangle = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(triangle)

    def poses(objects: list[bpy.types.Object]) -> list[np.ndarray]:
        found: list[np.ndarray] = []
        failed: list[Exception] = []
        viewport, hidden = bpy.context.evaluated_depsgraph_get(), [obj for obj in objects if obj.hide_render]

        def work(depsgraph: bpy.types.Depsgraph) -> None:
            try:
                for obj in objects:
                    # Some Blenders evaluate nothing for renders that a collection hides there.
                    known = obj.evaluated_get(depsgraph).is_evaluated
                    found.append(geometry.pose(obj, depsgraph if known else viewport))
            except Exception as error:  # Blender would only print it.
                failed.append(error)

        VRTM_RE_evaluation.work, before = work, scene.render.engine
        with session.during("writing"):
            try:
                scene.render.engine = VRTM_RE_evaluation.bl_idname
                for obj in hidden:
                    obj.hide_render = False
                bake(scene, bpy.context.view_layer, triangle)
            finally:
                scene.render.engine = before
                for obj in hidden:
                    obj.hide_render = True
        for error in failed:
            raise error
        return found

    try:
        yield poses
    finally:
        if name in bpy.data.meshes:
            # With the object.
            bpy.data.meshes.remove(bpy.data.meshes[name])
        bpy.utils.unregister_class(VRTM_RE_evaluation)
