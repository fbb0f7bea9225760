"""The Geometry Nodes group `vrtm carry`, which moves points, hair curves and instances to where attributes, or the
files of a bake, say that they are."""

from __future__ import annotations

import functools

import bpy

from . import modifier_group
from .modifier_group import image_of, set_input

# Vectors of points, or of hair curves, in the object's own space: where it is at rest, where it is carried to, and its
# turn as Euler angles (XYZ). And where the files of a bake have it: u, v of its place, and v of its turn.
ROOT, PLACE, TURN, TEXEL = NAMES = ("vrtm_root", "vrtm_carried", "vrtm_turn", "vrtm_texel")


def _fill(tree: bpy.types.NodeTree) -> None:
    link, node = tree.links.new, functools.partial(modifier_group.node, tree)

    def attribute(name: str, x: int, y: int) -> bpy.types.Node:
        made = node("GeometryNodeInputNamedAttribute", x, y, data_type="FLOAT_VECTOR")
        made.inputs["Name"].default_value = name
        return made

    def value(of: bpy.types.Node) -> bpy.types.NodeSocket:
        # There may be a socket of this name for each type; the one of the chosen type is enabled.
        return next(socket for socket in of.outputs if socket.enabled)

    given = node("NodeGroupInput", 0, 0)
    frame, clamp = node("GeometryNodeInputSceneTime", 0, -2), node("ShaderNodeClamp", 1, -2)
    for source, name in (
        (frame.outputs["Frame"], "Value"),
        (given.outputs["First"], "Min"),
        (given.outputs["Last"], "Max"),
    ):
        link(source, clamp.inputs[name])
    texel = node("ShaderNodeSeparateXYZ", 1, -3)
    link(value(attribute(TEXEL, 0, -3)), texel.inputs[0])

    def either(name: str, v: str, y: int) -> bpy.types.NodeSocket:
        """The attribute, or what the bake has."""
        at, image = node("ShaderNodeCombineXYZ", 2, y - 2), node("GeometryNodeImageTexture", 3, y - 2)
        image.interpolation, image.extension = "Closest", "EXTEND"
        link(texel.outputs["X"], at.inputs["X"])
        link(texel.outputs[v], at.inputs["Y"])
        link(at.outputs[0], image.inputs["Vector"])
        link(given.outputs["Image"], image.inputs["Image"])
        link(clamp.outputs[0], image.inputs["Frame"])
        chosen = node("GeometryNodeSwitch", 4, y, input_type="VECTOR")
        for source, socket in (
            (given.outputs["Baked"], "Switch"),
            (value(attribute(name, 3, y)), "False"),
            (image.outputs["Color"], "True"),
        ):
            link(source, next(one for one in chosen.inputs if one.name == socket and one.enabled))
        return value(chosen)

    place, turn = either(PLACE, "Y", 2), node("FunctionNodeEulerToRotation", 5, -1)
    link(either(TURN, "Z", -1), turn.inputs[0])
    root, position = attribute(ROOT, 4, 4), node("GeometryNodeInputPosition", 4, 5)
    # Of what is not a root itself, as the points of a hair, the offset is turned.
    offset, turned = node("ShaderNodeVectorMath", 5, 4, operation="SUBTRACT"), node("FunctionNodeRotateVector", 6, 4)
    moved = node("ShaderNodeVectorMath", 7, 3, operation="ADD")
    link(position.outputs[0], offset.inputs[0])
    link(value(root), offset.inputs[1])
    link(offset.outputs[0], turned.inputs["Vector"])
    link(turn.outputs[0], turned.inputs["Rotation"])
    link(place, moved.inputs[0])
    link(turned.outputs[0], moved.inputs[1])
    put, turns = node("GeometryNodeSetPosition", 8, 1), node("GeometryNodeRotateInstances", 9, 1)
    link(given.outputs["Geometry"], put.inputs["Geometry"])
    link(moved.outputs[0], put.inputs["Position"])
    link(put.outputs["Geometry"], turns.inputs["Instances"])
    link(turn.outputs[0], turns.inputs["Rotation"])
    turns.inputs["Local Space"].default_value = False
    link(position.outputs[0], turns.inputs["Pivot Point"])
    for one in (put, turns):
        link(root.outputs["Exists"], one.inputs["Selection"])
    link(turns.outputs["Instances"], node("NodeGroupOutput", 10, 1).inputs[0])


GROUP = modifier_group.ModifierGroup(
    "vrtm carry", "vrtm_carry_group", {"Baked": "Bool", "Image": "Image", "First": "Int", "Last": "Int"}, _fill
)


def remove(obj: bpy.types.Object) -> None:
    """Takes the modifier away, and what nothing uses any more."""
    show_live(obj)
    GROUP.remove(obj)


def show_baked(obj: bpy.types.Object, path: str, first: int, last: int) -> None:
    """Has the modifier read files, of which this is that of the first frame."""
    modifier = GROUP.modifier_of(obj)
    if modifier is None:
        return
    show_live(obj)
    image = bpy.data.images.load(path)
    image.name, image.source = f"vrtm carried {obj.name}", "SEQUENCE"
    image.colorspace_settings.name, image.alpha_mode = "Non-Color", "CHANNEL_PACKED"
    image.filepath = bpy.path.relpath(path) if bpy.data.filepath else path
    for name, value in (("Image", image), ("First", first), ("Last", last), ("Baked", True)):
        set_input(modifier, name, value)
    obj.update_tag()


def show_live(obj: bpy.types.Object) -> None:
    """Has the modifier read the attributes."""
    modifier = GROUP.modifier_of(obj)
    image = None if modifier is None else image_of(modifier)
    if image is None:
        return
    set_input(modifier, "Baked", False)
    set_input(modifier, "Image", None)
    obj.update_tag()
    if not image.users:
        bpy.data.images.remove(image)
