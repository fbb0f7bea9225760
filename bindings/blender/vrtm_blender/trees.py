"""Node trees of this add-on: their nodes, and the groups of its Geometry Nodes modifiers."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import bpy


class ModifierGroup(NamedTuple):
    """A group that all modifiers of one kind share."""

    # With a dot in front, Blender does not list the group.
    name: str
    # The custom property that tells the group from others, whatever it is called.
    mark: str
    # Types of the inputs beside the geometry, by their names.
    inputs: dict[str, str]
    # Makes the nodes.
    fill: Callable[[bpy.types.NodeTree], None]

    def tree(self) -> bpy.types.NodeTree:
        """The group, made when it is first asked for."""
        for tree in bpy.data.node_groups:
            if tree.bl_idname == "GeometryNodeTree" and tree.get(self.mark) and tree.library is None:
                return tree
        tree = bpy.data.node_groups.new(self.name, "GeometryNodeTree")
        tree[self.mark] = True
        # Not one that Blender offers to the artist among its modifiers.
        tree.is_modifier = False
        for in_out in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
        for name, kind in self.inputs.items():
            tree.interface.new_socket(name, in_out="INPUT", socket_type=f"NodeSocket{kind}")
        self.fill(tree)
        return tree

    def is_of(self, modifier: bpy.types.Modifier) -> bool:
        tree = modifier.node_group if modifier.type == "NODES" else None
        return tree is not None and bool(tree.get(self.mark))

    def modifier_of(self, obj: bpy.types.Object) -> bpy.types.Modifier | None:
        return next(filter(self.is_of, obj.modifiers), None)

    def insert(self, obj: bpy.types.Object, at: int | None = None) -> bpy.types.Modifier:
        """A new modifier, at this place among the object's, or last."""
        made = obj.modifiers.new(self.name.removeprefix("."), "NODES")
        made.node_group, made.show_in_editmode = self.tree(), False
        if at is not None:
            obj.modifiers.move(len(obj.modifiers) - 1, at)
        return made

    def remove(self, obj: bpy.types.Object) -> None:
        """Takes the object's modifiers away, and the group with the last one."""
        for modifier in list(filter(self.is_of, obj.modifiers)):
            tree = modifier.node_group
            obj.modifiers.remove(modifier)
            if not tree.users and tree.library is None:
                bpy.data.node_groups.remove(tree)


def node(tree: bpy.types.NodeTree, kind: str, x: float, y: float, **settings: object) -> bpy.types.Node:
    """A new node, in a column and a row."""
    made = tree.nodes.new(kind)
    made.location = (220 * x, 180 * y)
    for name, value in settings.items():
        setattr(made, name, value)
    return made


def operate(
    tree: bpy.types.NodeTree, kind: str, operation: str, x: float, y: float, *inputs: object
) -> bpy.types.NodeSocket:
    """The output of a new node of the kind "Math" or "VectorMath", of sockets and values."""
    made = node(tree, f"ShaderNode{kind}", x, y, operation=operation)
    for socket, value in zip(made.inputs, inputs):
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        else:
            socket.default_value = value
    return enabled(made.outputs)


def texture(
    tree: bpy.types.NodeTree, image: bpy.types.Image, x: float, y: float, at: bpy.types.NodeSocket | None = None
) -> bpy.types.Node:
    """A new Image Texture node of a shader, looked up at `at`."""
    made = node(tree, "ShaderNodeTexImage", x, y, image=image, interpolation="Linear", extension="EXTEND")
    if at is not None:
        tree.links.new(at, made.inputs["Vector"])
    return made


def enabled(sockets, name: str = "") -> bpy.types.NodeSocket:
    """The socket of a name, or of any: a node may have one for each type, and the one of the chosen type is enabled."""
    return next(socket for socket in sockets if socket.enabled and name in ("", socket.name))
