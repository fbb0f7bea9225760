"""Writes results into Blender's data, on the main thread: images of the redirection, and a UV map."""

from __future__ import annotations

import bpy
import numpy as np

from . import carry, geometry, layers, materials, nodes, overlay, session
from .messages import Problem
from .outcome import Outcome, Request
from .result_image import LAYOUT, Layout, has_pixels, is_result
from .states import State

# As the settings name them.
OUTPUTS = ("image", "uvs", "strain")


def missing(obj: bpy.types.Object) -> str | None:
    """The missing part of the object's results, in words: an undo, a file or the artist may have removed it."""
    settings = obj.vrtm
    if not obj.vrtm.is_set_up:
        return None
    if settings.write_image:
        if not is_result(settings.image):
            return "The result image is not there"
        if not all(map(has_pixels, layers.images_of(settings.image))):
            return "The result image is empty"
        lost = layers.missing(obj)
        if lost is not None:
            return lost
        if nodes.stale_groups(obj):
            return "The material's node group has lost the result image"
        owner = owner_of_image(obj)
        if owner is not None:
            return f"The redirection that is shown is that of {owner.name!r}"
    for tree in materials.of_others(obj):
        return f"A material shows the redirection of another object ({tree.name!r})"
    if is_written(obj, "uvs") and settings.uv_name not in obj.data.uv_layers:
        return "The result UV map is not there"
    name = strain_name(settings)
    if is_written(obj, "strain") and name not in obj.data.attributes:
        return f"The result attribute {name!r} is not there"
    return None


def is_written(obj: bpy.types.Object, output: str) -> bool:
    """True if an output is switched on, and can be written: a linked mesh takes nothing."""
    return getattr(obj.vrtm, f"write_{output}") and (output == "image" or not geometry.is_linked(obj))


def publish(obj: bpy.types.Object, state: State, request: Request, outcome: Outcome) -> None:
    """Writes the outcome of a job."""
    # Updates until now are the artist's; those of the writes are not.
    _update()
    with session.during("writing"):
        if not geometry.is_linked(obj):
            own_name(obj)
        if outcome.images is not None:
            write_image(obj, outcome.layout, *outcome.images)
            layers.write(obj, outcome.layers)
        if outcome.uvs is not None:
            write_uvs(obj, outcome.uvs)
        if outcome.surface is not None:
            geometry.write(obj.data, strain_name(obj.vrtm), "POINT", "FLOAT_VECTOR", outcome.surface)
            if not session.rendering:
                obj.data.update_tag()
        if obj.vrtm.is_set_up:
            own_materials(obj)
        if outcome.strain is not None:
            overlay.write(obj, outcome.strain)
        carry.place(obj, outcome.carried)
        _update()
    state.shown, state.figures, state.uvs, state.rewrite = request.stamp, outcome.figures, outcome.uvs, False
    state.features, state.looked_at = outcome.features, 0
    state.notes = list(outcome.notes) if obj.vrtm.is_set_up else []
    state.questions = list(outcome.questions) if obj.vrtm.is_set_up else []
    still_right(state, request)
    if obj.vrtm.is_set_up and all(output is None for output in (outcome.images, outcome.uvs, outcome.surface)):
        state.notes.append("No output is switched on: see Quality and Outputs")
    state.say("")


def _update() -> None:
    """Has Blender evaluate the changes, so that its handlers are called now."""
    layer = bpy.context.view_layer
    if layer is not None and not (session.rendering or session.baking or session.handling):
        layer.update()


def still_right(state: State, request: Request) -> None:
    """Notes that the result of this request is shown."""
    state.frame, state.fresh = request.frame, True
    if state.stamps == state.prepared.stamps:
        # Inputs that were read again are in the asset already.
        state.inputs.take()


def is_shown(obj: bpy.types.Object, state: State, request: Request) -> bool:
    """True if the result of this request was written last, and is there."""
    return request.stamp == state.shown and missing(obj) is None


def was_taken_back(obj: bpy.types.Object, state: State) -> bool:
    """True if an undo has taken back a UV map that was written after the undo's step. Pixels of images stay."""
    if not state.rewrite or state.uvs is None or obj.vrtm.uv_name not in obj.data.uv_layers:
        return False
    return not np.array_equal(geometry.read(obj.data.uv_layers[obj.vrtm.uv_name].uv, "vector", 2), state.uvs)


def write_image(obj: bpy.types.Object, layout: Layout, *pixels: np.ndarray) -> None:
    """Writes the images of all layers."""
    for image, values in zip(own_images(obj, layout, len(pixels)), pixels):
        image.pixels.foreach_set(values.ravel())
        image.update()
        # Tells viewport renders that the image has changed.
        image.update_tag()


def resize(image: bpy.types.Image, size: tuple[int, int]) -> None:
    if not image.size[0]:
        # Its file is gone: it is one in memory again.
        image.source, image.use_generated_float = "GENERATED", True
        image.generated_width, image.generated_height = size
    elif tuple(image.size) != size:
        image.scale(*size)


def owner_of_image(obj: bpy.types.Object) -> bpy.types.Object | None:
    """The object whose result the object's image is, if it is another: a duplicate begins with the original's."""
    image, uid = obj.vrtm.image, obj.session_uid
    if not is_result(image):
        return None
    others = [other for other in bpy.data.objects if other.vrtm.image == image and other.session_uid < uid]
    return min(others, key=lambda one: one.session_uid, default=None)


def separate(obj: bpy.types.Object) -> None:
    """Gives a duplicate images of its own, and materials that look them up."""
    if owner_of_image(obj) is not None:
        before = obj.vrtm.image
        size, layout, number = before.size, list(before[LAYOUT]), before.get(layers.NUMBER, 1)
        obj.vrtm.image = _new_image(obj, *size)
        for image in layers.own_images(obj.vrtm.image, number, lambda layer: _new_image(obj, *size, layer)):
            image[LAYOUT] = layout
        materials.separate(obj, lambda tree: nodes.image_of(tree) == before, nodes.group_by_image)


def own_materials(obj: bpy.types.Object) -> None:
    """Has materials that were taken from another object, or that an undo has brought back, show this one's result."""
    for kind, own in ((nodes.BY_IMAGE, nodes.group_by_image), (nodes.BY_UV_MAP, nodes.group_by_uv_map)):
        others = [tree for tree in materials.of_others(obj) if tree[nodes.KIND] == kind]
        if others:
            materials.separate(obj, others.__contains__, own)


def _new_image(obj: bpy.types.Object, width: int, height: int, layer: int = 0) -> bpy.types.Image:
    name = f"vrtm {obj.name} layer {layer}" if layer else f"vrtm {obj.name}"
    image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=True, is_data=True)
    image.alpha_mode = "CHANNEL_PACKED"
    image.file_format = "OPEN_EXR"
    return image


def own_images(obj: bpy.types.Object, layout: Layout, number: int) -> list[bpy.types.Image]:
    """The object's result images, one for each layer, in the layout's size."""
    settings = obj.vrtm
    separate(obj)
    size = layout.width, layout.height
    if not is_result(settings.image) or settings.image.library is not None:
        settings.image = _new_image(obj, *size)
    images = layers.own_images(settings.image, number, lambda layer: _new_image(obj, *size, layer))
    rebuild = False
    for image in images:
        resize(image, size)
        before, now = list(image.get(LAYOUT, ())), layout.numbers()
        if before != now:
            image[LAYOUT] = now
            # In a group that looks up one tile there is no size.
            rebuild |= before[:4] != now[:4] or now[2:4] != [1, 1]
    nodes.update_groups(obj, rebuild)
    layers.remove_unused()
    return images


def write_uvs(obj: bpy.types.Object, uvs: np.ndarray) -> None:
    mesh = obj.data
    layer = own_layer(obj)
    # A write makes Blender evaluate the mesh again: only if there is something to write.
    if np.array_equal(geometry.read(layer.uv, "vector", 2), uvs):
        return
    layer.uv.foreach_set("vector", np.ascontiguousarray(uvs, np.float32).ravel())
    if not session.rendering:
        mesh.update_tag()
    # In a render a tag would have the mesh evaluated again with the shape keys' values of the frame that the viewport
    # is at. The render engine copies the mesh after this in any case; the viewport gets its tag when the render is
    # over.


def strain_name(settings: bpy.types.PropertyGroup) -> str:
    """The attribute for shaders."""
    return f"{settings.uv_name}_strain"


def names_of(settings: bpy.types.PropertyGroup) -> set[str]:
    """The names of all that an object's results write to the mesh."""
    return {settings.uv_name, strain_name(settings), layers.attribute_name(settings)}


def own_name(obj: bpy.types.Object) -> None:
    """Gives the object a name of its own for its results in the mesh: objects that share a mesh have one each."""
    mesh, settings, uid = obj.data, obj.vrtm, obj.session_uid
    before = settings.uv_name
    others = [other for other in bpy.data.objects if other != obj and other.data == mesh and other.vrtm.is_set_up]
    if any(other.vrtm.uv_name == before and other.session_uid < uid for other in others):
        settings.uv_name = f"vrtm {obj.name}"[:60]
        if settings.write_uvs:
            own_layer(obj)
            materials.separate(obj, lambda tree: nodes.is_by_uv_map(tree, before), nodes.group_by_uv_map)


def own_layer(obj: bpy.types.Object) -> bpy.types.MeshUVLoopLayer:
    """The object's result among the mesh's UV maps."""
    mesh, settings = obj.data, obj.vrtm
    layer = mesh.uv_layers.get(settings.uv_name)
    if layer is None:
        active = mesh.uv_layers.active_index
        layer = mesh.uv_layers.new(name=settings.uv_name, do_init=False)
        if layer is None:
            raise Problem(f"{obj.name} has eight UV maps already: delete one, or switch the UV Map output off")
        settings.uv_name = layer.name
        mesh.uv_layers.active_index = active
    return layer
