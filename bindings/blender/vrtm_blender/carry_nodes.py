"""The Geometry Nodes group `vrtm carry`, which moves points, hair curves and instances to where attributes, or the
files of a bake, say that they are."""

from __future__ import annotations

import bpy

from .modifier_inputs import image_of, set_input

GROUP_NAME = "vrtm carry"
MARK = "vrtm_carry_group"
# Vectors of points, or of hair curves, in the object's own space: where it is at rest, where it is carried to, and its
# turn as Euler angles (XYZ). And where the files of a bake have it: u, v of its place, and v of its turn.
ROOT, PLACE, TURN, TEXEL = NAMES = ("vrtm_root", "vrtm_carried", "vrtm_turn", "vrtm_texel")
_INPUTS = {"Baked": "Bool", "Image": "Image", "First": "Int", "Last": "Int"}


def group() -> bpy.types.NodeTree:
    """The group of all carry modifiers, made when it is first asked for."""
    for tree in bpy.data.node_groups:
        if tree.bl_idname == "GeometryNodeTree" and tree.get(MARK) and tree.library is None:
            return tree
    tree = bpy.data.node_groups.new(GROUP_NAME, "GeometryNodeTree")
    tree[MARK] = True
    # Not one that Blender offers to the artist among its modifiers.
    tree.is_modifier = False
    for in_out in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
    for name, kind in _INPUTS.items():
        tree.interface.new_socket(name, in_out="INPUT", socket_type=f"NodeSocket{kind}")
    _fill(tree)
    return tree


def _fill(tree: bpy.types.NodeTree) -> None:
    link = tree.links.new

    def node(kind: str, x: int, y: int, **settings: object) -> bpy.types.Node:
        made = tree.nodes.new(kind)
        made.location = (220 * x, 180 * y)
        for name, value in settings.items():
            setattr(made, name, value)
        return made

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


def is_ours(modifier: bpy.types.Modifier) -> bool:
    return modifier.type == "NODES" and modifier.node_group is not None and bool(modifier.node_group.get(MARK))


def modifier_of(obj: bpy.types.Object) -> bpy.types.Modifier | None:
    return next(filter(is_ours, obj.modifiers), None)


def insert(obj: bpy.types.Object, first: bool) -> None:
    """Puts the modifier first or last."""
    made = obj.modifiers.new(GROUP_NAME, "NODES")
    made.node_group, made.show_in_editmode = group(), False
    if first:
        obj.modifiers.move(len(obj.modifiers) - 1, 0)


def remove(obj: bpy.types.Object) -> None:
    """Takes the modifier away, and what nothing uses any more."""
    show_live(obj)
    for modifier in list(filter(is_ours, obj.modifiers)):
        tree = modifier.node_group
        obj.modifiers.remove(modifier)
        if not tree.users and tree.library is None:
            bpy.data.node_groups.remove(tree)


def show_baked(obj: bpy.types.Object, path: str, first: int, last: int) -> None:
    """Has the modifier read files, of which this is that of the first frame."""
    modifier = modifier_of(obj)
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
    modifier = modifier_of(obj)
    image = None if modifier is None else image_of(modifier)
    if image is None:
        return
    set_input(modifier, "Baked", False)
    set_input(modifier, "Image", None)
    obj.update_tag()
    if not image.users:
        bpy.data.images.remove(image)
