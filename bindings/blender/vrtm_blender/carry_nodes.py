"""The Geometry Nodes group `vrtm carry`, which moves points, hair curves and instances to the places in attributes,
or in the files of a bake."""

from __future__ import annotations

from functools import partial

import bpy

from . import packed, trees
from .versions import image_of, set_input

# Vectors of points, or of hair curves, in the object's own space: where its data has it, where it is carried to, and
# its turn from there as Euler angles (XYZ). And where the files of a bake have it: u, v of its place, v of its turn.
ROOT, PLACE, TURN, TEXEL = "vrtm_root", "vrtm_carried", "vrtm_turn", "vrtm_texel"
# And a transform, in that space: from where its data has it, in the pose in which it was bound, to where it is at rest.
TO_REST = "vrtm_to_rest"
NAMES = (ROOT, PLACE, TURN, TEXEL, TO_REST)


def _fill(tree: bpy.types.NodeTree) -> None:
    link, node, value = tree.links.new, partial(trees.node, tree), trees.enabled

    def attribute(name: str, x: int, y: int) -> bpy.types.Node:
        made = node("GeometryNodeInputNamedAttribute", x, y, data_type="FLOAT_VECTOR")
        made.inputs["Name"].default_value = name
        return made

    given = node("NodeGroupInput", 0, 0)
    frame, clamp = node("GeometryNodeInputSceneTime", 0, -2), node("ShaderNodeClamp", 1, -2)
    for source, name in (
        (frame.outputs["Frame"], "Value"),
        (given.outputs["First"], "Min"),
        (given.outputs["Last"], "Max"),
    ):
        link(source, clamp.inputs[name])
    texel = node("ShaderNodeSeparateXYZ", 1, -3)
    link(value(attribute(TEXEL, 0, -3).outputs), texel.inputs[0])

    def either(name: str, v: str, y: int) -> bpy.types.NodeSocket:
        """The attribute, or the texel of the bake."""
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
            (value(attribute(name, 3, y).outputs), "False"),
            (image.outputs["Color"], "True"),
        ):
            link(source, value(chosen.inputs, socket))
        return value(chosen.outputs)

    place, turn = either(PLACE, "Y", 2), node("FunctionNodeEulerToRotation", 5, -1)
    link(either(TURN, "Z", -1), turn.inputs[0])
    root, position = attribute(ROOT, 4, 4), node("GeometryNodeInputPosition", 4, 5)
    # Of what is not a root itself, as the points of a hair, the offset is turned.
    turned = node("FunctionNodeRotateVector", 6, 4)
    offset = trees.operate(tree, "VectorMath", "SUBTRACT", 5, 4, position.outputs[0], value(root.outputs))
    link(offset, turned.inputs["Vector"])
    link(turn.outputs[0], turned.inputs["Rotation"])
    moved = trees.operate(tree, "VectorMath", "ADD", 7, 3, place, turned.outputs[0])
    put, turns = node("GeometryNodeSetPosition", 8, 1), node("GeometryNodeRotateInstances", 9, 1)
    link(given.outputs["Geometry"], put.inputs["Geometry"])
    link(moved, put.inputs["Position"])
    link(put.outputs["Geometry"], turns.inputs["Instances"])
    link(turn.outputs[0], turns.inputs["Rotation"])
    turns.inputs["Local Space"].default_value = False
    link(position.outputs[0], turns.inputs["Pivot Point"])
    for one in (put, turns):
        link(root.outputs["Exists"], one.inputs["Selection"])
    link(turns.outputs["Instances"], node("NodeGroupOutput", 10, 1).inputs[0])


GROUP = trees.ModifierGroup(
    "vrtm carry", "vrtm_carry_group", {"Baked": "Bool", "Image": "Image", "First": "Int", "Last": "Int"}, _fill
)


def remove(obj: bpy.types.Object) -> None:
    """Removes the modifier, and its unused data."""
    show_live(obj)
    GROUP.remove(obj)


def show_baked(obj: bpy.types.Object, path: str, first: int, last: int) -> None:
    """Has the modifier read files, of which this is that of the first frame."""
    modifier = GROUP.modifier_of(obj)
    if modifier is None:
        return
    show_live(obj)
    image = packed.from_file(path, "SEQUENCE")
    image.name = f"vrtm carried {obj.name}"
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
